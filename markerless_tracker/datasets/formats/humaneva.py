"""HumanEva-II: a subject's folder with images, `.cal`, `.ofs`, mocap and background clips."""

import re
from pathlib import Path
from typing import NamedTuple

from markerless_tracker.camera import CameraRig
from markerless_tracker.camera.cal_file import read_cal
from markerless_tracker.datasets.background import MAX_FRAMES
from markerless_tracker.datasets.folder import VideoRecording
from markerless_tracker.datasets.formats.humaneva_background import mixture_of, read_statistics
from markerless_tracker.datasets.formats.humaneva_mocap import Sync, read_mocap, read_sync
from markerless_tracker.datasets.formats.numbers import image_sizes
from markerless_tracker.datasets.markers.track import MarkerTrack
from markerless_tracker.datasets.video.images import (
    VIDEO_SUFFIXES,
    numbered_files,
    open_stream,
)
from markerless_tracker.errors import DatasetError
from markerless_tracker.imaging import (
    BackgroundModel,
    Image,
    scale_background_model,
    scale_image,
)

FPS = 60.0
CALIBRATION = "Calibration_Data"
_IMAGES, _SYNC, _MOCAP = "Image_Data", "Sync_Data", "Mocap_Data"
_BACKGROUND = "Background"
_NAME = re.compile(r"(?P<trial>.+)_\((?P<camera>[A-Za-z]+\d+)\)")


class _View(NamedTuple):
    trial: str
    camera: str
    path: Path


class HumanEvaRecording(VideoRecording):
    """A trial of HumanEva-II, at 60 frames per second, world in m with z up.

    Read are `Image_Data/TRIAL_(C1)` (a folder of numbered images, or a video),
    `Calibration_Data/C1.cal`, and where they exist `Mocap_Data/TRIAL.c3d` or `.trc` for the
    reference markers, which need `Sync_Data/TRIAL_(C1).ofs`, and for the empty scene
    `Background/Background_*_(C1)` or the statistics `Background_(C1).mat`.

    Args:
        path: the subject's folder, or the images of one camera in it, which choose the trial.
        scale: factor for all images.
        input_fps: another rate, 1/s.

    Raises:
        DatasetError: no trial or several, or a file is missing or malformed.
        CalibrationError: a `.cal` is missing or malformed.
    """

    def __init__(self, path: Path, *, scale: float = 1.0, input_fps: float | None = None) -> None:
        subject, trial = _chosen(path)
        sources = {view.camera: view.path for view in _views(subject) if view.trial == trial}
        sizes = image_sizes(sources)
        cameras = [
            read_cal(subject / CALIBRATION / f"{name}.cal", name, sizes[name]) for name in sources
        ]
        rig = CameraRig(tuple(cameras))
        super().__init__(
            subject, sources, rig, scale=scale, input_fps=FPS if input_fps is None else input_fps
        )
        self.name = f"{subject.resolve().name}_{trial}"
        self._trial = trial

    def _ground_truth(self) -> MarkerTrack | None:
        """The joints that the mocap has, at the stamps of the images; None without mocap.

        Raises:
            DatasetError: the mocap or an `.ofs` cannot be read, or cameras differ in their sync.
        """
        for suffix in (".c3d", ".trc"):
            path = self.path / _MOCAP / f"{self._trial}{suffix}"
            if path.is_file():
                return read_mocap(path, self._sync(), self.fps)
        return super()._ground_truth()

    def background_frames(self, folder: Path | None = None) -> dict[str, list[Image]]:
        """Camera -> images of the empty scene: of its clips, evenly, else the means of its `.mat`.

        Raises:
            DatasetError: a clip or file cannot be read, or has images of another size.
        """
        if folder is not None:
            return super().background_frames(folder)
        found = {}
        for camera in self.rig:
            clips = _clips(self.path / _BACKGROUND, camera.name)
            statistics = self._statistics(camera.name)
            images = [image for clip in clips for image in _evenly(clip, MAX_FRAMES // len(clips))]
            if not clips and statistics.is_file():
                images = [statistic.image for statistic in read_statistics(statistics)]
            for image in images:
                self._check_size(camera.name, (image.shape[1], image.shape[0]))
            if images:
                found[camera.name] = [scale_image(image, camera.size_px) for image in images]
        return found

    def background_models(self, folder: Path | None = None) -> dict[str, BackgroundModel]:
        """Camera -> the Gaussians of its `.mat`, where it has variances and there are no clips.

        Raises:
            DatasetError: a file cannot be read, or is of another size.
        """
        if folder is not None:
            return super().background_models(folder)
        found = {}
        for camera in self.rig:
            statistics = self._statistics(camera.name)
            if _clips(self.path / _BACKGROUND, camera.name) or not statistics.is_file():
                continue
            model = mixture_of(read_statistics(statistics))
            if model is not None:
                self._check_size(camera.name, model.size_px)
                found[camera.name] = scale_background_model(model, camera.size_px)
        return found

    def _statistics(self, camera: str) -> Path:
        return self.path / _BACKGROUND / f"{_BACKGROUND}_({camera}).mat"

    def _check_size(self, camera: str, came: tuple[int, int]) -> None:
        stored = self._stored_sizes_px[camera]
        if came != stored:
            raise DatasetError(
                f"{self.path / _BACKGROUND}: {camera}: images of {came[0]}x{came[1]} px, expected "
                f"{stored[0]}x{stored[1]} px"
            )

    def _sync(self) -> Sync:
        found = {
            name: read_sync(self.path / _SYNC / f"{self._trial}_({name}).ofs")
            for name in self.rig.names
        }
        first = next(iter(found.values()))
        for name, sync in found.items():
            if not sync.agrees(first):
                raise DatasetError(
                    f"{self.path / _SYNC}: {self._trial}_({name}).ofs is {sync}, that of the first "
                    f"camera {first}: expected cameras in step, as in HumanEva-II"
                )
        return first


def is_humaneva(path: Path) -> bool:
    """Whether a path is a subject's folder, or the images of a camera in it."""
    subject = subject_folder(path)
    return (subject / _IMAGES).is_dir() and (subject / CALIBRATION).is_dir()


def subject_folder(path: Path) -> Path:
    """The folder above the images of a camera; the path itself if it names no such images."""
    of_camera = path.parent.name == _IMAGES and _NAME.fullmatch(_stem(path))
    return path.parent.parent if of_camera else path


def trials(path: Path) -> list[Path]:
    """Images of one camera of each trial of a subject."""
    return list({view.trial: view.path for view in reversed(_views(path))}.values())[::-1]


def _chosen(path: Path) -> tuple[Path, str]:
    """The subject's folder and the trial."""
    match = _NAME.fullmatch(_stem(path))
    if match is not None and path.parent.name == _IMAGES:
        return path.parent.parent, match["trial"]
    trials = sorted({view.trial for view in _views(path)})
    if len(trials) != 1:
        listed = ", ".join(trials) or "none"
        raise DatasetError(
            f"{path / _IMAGES}: trials {listed}, expected one TRIAL_(CAMERA) for each camera, or "
            "the images of one camera as the source"
        )
    return path, trials[0]


def _views(subject: Path) -> list[_View]:
    """The images in a subject's folder; a folder of images goes before a video."""
    folder, views = subject / _IMAGES, {}
    for entry in sorted(folder.iterdir()) if folder.is_dir() else []:
        match = _NAME.fullmatch(_stem(entry))
        video = entry.suffix.lower() in VIDEO_SUFFIXES and entry.is_file()
        if match and (video or (entry.is_dir() and numbered_files(entry))):
            key = (match["trial"], match["camera"])
            if key not in views or not video:
                views[key] = _View(*key, entry)
    return list(views.values())


def _stem(path: Path) -> str:
    return path.stem if path.suffix.lower() in VIDEO_SUFFIXES else path.name


def _clips(folder: Path, camera: str) -> list[Path]:
    """The clips of the empty scene of a camera."""
    found: dict[str, Path] = {}
    for entry in sorted(folder.glob(f"{_BACKGROUND}_*_({camera})*")):
        if entry.is_dir() or entry.suffix.lower() in VIDEO_SUFFIXES:
            found.setdefault(_stem(entry), entry)
    return list(found.values())


def _evenly(clip: Path, most: int) -> list[Image]:
    """Images of a clip, evenly spread."""
    stream = open_stream(clip)
    every = max(1, -(-(stream.frame_count or most) // max(1, most)))
    images: list[Image] = []
    while len(images) < most and (image := stream.read()) is not None:
        images.append(image)
        for _ in range(every - 1):
            stream.skip()
    stream.close()
    return images
