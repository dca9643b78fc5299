"""Videos or image folders with calibrations by OpenCV, ROS or EasyMocap beside them."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from markerless_tracker.camera import CameraRig
from markerless_tracker.camera.yaml_files import (
    EXTRINSICS,
    read_camera,
    read_extrinsics,
    read_pair,
)
from markerless_tracker.datasets.folder import VideoRecording
from markerless_tracker.datasets.formats.numbers import image_sizes
from markerless_tracker.datasets.recording import BACKGROUND
from markerless_tracker.datasets.video.images import VIDEO_SUFFIXES, find_stream, numbered_files
from markerless_tracker.errors import DatasetError

SUFFIXES = (".yaml", ".yml", ".xml", ".json")
INTRINSICS, POSES = "intri.yml", "extri.yml"
_FOLDERS = (".", "videos", "images")
_NO_CAMERAS = ("videos", "images", "calibration", BACKGROUND, "masks")


class OpenCVRecording(VideoRecording):
    """A folder with a calibration file per camera, or with `intri.yml` and `extri.yml`.

    The images of camera NAME are the video `NAME.mp4` (.mkv, .avi, .mov) or the folder `NAME` of
    numbered images, in the folder itself, in `videos/` or in `images/`; its calibration is
    `NAME.yaml` (.yml, .xml, .json), in the folder or in `calibration/`. Poses may also be given in
    `extrinsics.yaml`.

    Raises:
        DatasetError: no camera has both images and a calibration.
        CalibrationError: a calibration is malformed.
    """

    def __init__(self, path: Path, *, scale: float = 1.0, input_fps: float | None = None) -> None:
        if _is_pair(path):
            sources = _all_sources(path)
            if not sources:
                raise DatasetError(f"{path}: no images, expected videos/NAME.mp4 or images/NAME/")
            rig = read_pair(path / INTRINSICS, path / POSES, image_sizes(sources))
        else:
            files = _calibrations(path)
            found = {name: _source(path, name) for name in files}
            sources = {name: source for name, source in found.items() if source is not None}
            if not sources:
                raise DatasetError(
                    f"{path}: no images of {', '.join(files) or 'any camera'}, expected NAME.mp4 "
                    "or a folder NAME beside NAME.yaml"
                )
            sizes = image_sizes(sources)
            poses_file = _beside(path, EXTRINSICS)
            poses = {} if poses_file is None else read_extrinsics(poses_file)
            cameras = [
                read_camera(files[name], name, sizes[name], poses.get(name)) for name in sources
            ]
            rig = CameraRig(tuple(cameras))
        super().__init__(path, sources, rig, scale=scale, input_fps=input_fps)
        self._warn_of_others(sources)

    def _warn_of_others(self, sources: Mapping[str, Path]) -> None:
        """Warn of calibrations without images and of images without a calibration."""
        files = {} if _is_pair(self.path) else _calibrations(self.path)
        for name, file in files.items():
            if name not in sources:
                self.warn(f"{file}: left out, there are no images of {name}")
        for name, images in _all_sources(self.path, _FOLDERS).items():
            if name not in sources and name not in _NO_CAMERAS:
                self.warn(f"{images}: left out, there is no calibration {name}{SUFFIXES[0]}")


def is_opencv(path: Path) -> bool:
    """Whether a folder has a calibration of this kind with images for it."""
    if _is_pair(path):
        return True
    return any(_source(path, name) is not None for name in _calibrations(path))


def _is_pair(path: Path) -> bool:
    return (path / INTRINSICS).is_file() and (path / POSES).is_file()


def _calibrations(path: Path) -> dict[str, Path]:
    """Camera -> its file."""
    found: dict[str, Path] = {}
    for folder in (path, path / "calibration"):
        for file in sorted(folder.glob("*")) if folder.is_dir() else []:
            if file.suffix.lower() in SUFFIXES and file.name != EXTRINSICS:
                found.setdefault(file.stem, file)
    return found


def _beside(path: Path, name: str) -> Path | None:
    places = (path / name, path / "calibration" / name)
    return next((place for place in places if place.is_file()), None)


def _source(path: Path, name: str) -> Path | None:
    places = (path / folder for folder in _FOLDERS)
    return next((found for place in places if (found := find_stream(place, name))), None)


def _all_sources(path: Path, folders: Sequence[str] = _FOLDERS[1:]) -> dict[str, Path]:
    """Camera -> images, of all in some folders of a recording."""
    found: dict[str, Path] = {}
    for folder in (path / name for name in folders):
        for entry in sorted(folder.iterdir()) if folder.is_dir() else []:
            if entry.suffix.lower() in VIDEO_SUFFIXES and entry.is_file():
                found.setdefault(entry.stem, entry)
            elif entry.is_dir() and numbered_files(entry):
                found.setdefault(entry.name, entry)
    return found
