"""Recordings without a calibration, opened under nominal cameras: for calibrating them."""

from pathlib import Path

from markerless_tracker.camera import CameraRig
from markerless_tracker.camera.model import nominal_camera
from markerless_tracker.datasets.folder import VideoRecording
from markerless_tracker.datasets.recording import BACKGROUND, Recording
from markerless_tracker.datasets.source import detect_format
from markerless_tracker.datasets.video.images import (
    VIDEO_SUFFIXES,
    NumberedImages,
    numbered_files,
    open_stream,
)
from markerless_tracker.errors import DatasetError

IMAGES_FPS = 1.0
"""Rate of numbered images, which state none."""
_NO_CAMERAS = (BACKGROUND, "masks")


def open_uncalibrated(path: str | Path) -> Recording:
    """Open the images of several cameras, whatever calibration is beside them.

    Read are videos `NAME.mp4` (.mkv, .avi, .mov) and folders `NAME/` of numbered images, in the
    folder itself or in its `videos/`, or a bag with images on `NAME/image_raw`. Images of one
    number, or of one stamp in a bag, belong together.

    Returns:
        The recording. Its rig has the names and image sizes; everything else is nominal.

    Raises:
        DatasetError: there is no such folder, it holds no images, or rates differ.
    """
    path = Path(path)
    if not path.exists():
        raise DatasetError(f"{path}: no such file or folder")
    if detect_format(path) == "bag":
        # rosbags and mcap are slow to import, and only bags need them.
        from markerless_tracker.datasets.bag.recording import BagRecording

        return BagRecording(path, nominal=True)
    if not path.is_dir():
        raise DatasetError(f"{path}: expected a folder with a video or image folder per camera")
    sources = _sources(path) or (_sources(path / "videos") if (path / "videos").is_dir() else {})
    if not sources:
        raise DatasetError(
            f"{path}: holds no images, expected cam01.mp4 (or .mkv, .avi, .mov, or a folder cam01/ "
            "of numbered images) for every camera"
        )
    cameras, numbered = [], False
    for name, source in sources.items():
        stream = open_stream(source, input_fps=None)
        stream.close()
        numbered |= isinstance(stream, NumberedImages)
        cameras.append(nominal_camera(name, stream.size_px))
    return VideoRecording(
        path, sources, CameraRig(tuple(cameras)), input_fps=IMAGES_FPS if numbered else None
    )


def _sources(folder: Path) -> dict[str, Path]:
    """Camera name -> video or folder of images, by name.

    Raises:
        DatasetError: a camera has two sources.
    """
    sources: dict[str, Path] = {}
    for path in sorted(folder.iterdir()):
        if path.is_dir():
            if path.name in _NO_CAMERAS or not numbered_files(path):
                continue
            name = path.name
        elif path.suffix.lower() in VIDEO_SUFFIXES:
            name = path.stem
        else:
            continue
        if name in sources:
            raise DatasetError(f"{path}: {name} has another source, {sources[name].name}")
        sources[name] = path
    return sources
