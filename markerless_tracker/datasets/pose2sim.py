"""Pose2Sim projects: `videos/*.mp4` and `calibration/*.toml` or a Qualisys `*.qca.txt`.

In a batch session the trials, each with its own `videos/`, share the calibration beside them.
"""

from collections.abc import Mapping
from pathlib import Path

from markerless_tracker.camera import CameraModel, CameraRig, read_calibration, read_qca
from markerless_tracker.datasets.folder import VideoRecording
from markerless_tracker.datasets.video.images import (
    IMAGE_SUFFIXES,
    VIDEO_SUFFIXES,
    numbered_files,
    open_stream,
    read_image,
)
from markerless_tracker.datasets.video.numbering import in_order
from markerless_tracker.errors import DatasetError
from markerless_tracker.imaging import Image, scale_image


class Pose2SimRecording(VideoRecording):
    """A Pose2Sim project of one trial, or a trial of a batch session.

    A video whose size differs from its calibration gets its K rescaled per axis, with a warning:
    projects often store videos a few pixels narrower than they were calibrated.

    Raises:
        DatasetError: no calibration, several, or videos that cannot be matched with its cameras.
    """

    def __init__(self, path: Path, *, scale: float = 1.0, input_fps: float | None = None) -> None:
        folder = calibration_folder(path)
        if folder is None:
            raise DatasetError(f"{path}: no calibration folder, expected {path / 'calibration'}")
        rig = _read_rig(folder)
        sources, notes = match_videos(path / "videos", rig)
        cameras = []
        for camera in rig:
            stream = open_stream(sources[camera.name], input_fps=input_fps)
            stream.close()
            if stream.size_px != camera.size_px:
                (came_w, came_h), (expected_w, expected_h) = stream.size_px, camera.size_px
                notes.append(
                    f"{camera.name}: {stream.path.name} is {came_w}x{came_h} px, calibrated at "
                    f"{expected_w}x{expected_h} px: its matrix was rescaled per axis"
                )
                camera = _stretched(camera, stream.size_px)
            cameras.append(camera)
        super().__init__(path, sources, CameraRig(tuple(cameras)), scale=scale, input_fps=input_fps)
        for note in notes:
            self.warn(note)
        self._calibration_folder = folder

    def room_stills(self) -> dict[str, list[Image]]:
        """Camera name -> stills of the room, from `calibration/extrinsics/NAME_ext.png`.

        They were taken for calibration, so people may be visible. Scaled to the videos' size.
        """
        folder = self._calibration_folder / "extrinsics"
        stills: dict[str, list[Image]] = {}
        for camera in self.rig:
            for suffix in IMAGE_SUFFIXES:
                path = folder / f"{camera.name}_ext{suffix}"
                if path.is_file():
                    stills.setdefault(camera.name, []).append(
                        scale_image(read_image(path), camera.size_px)
                    )
        return stills


def is_pose2sim(path: Path) -> bool:
    """Whether a folder is a project, or a trial of a batch session."""
    return (path / "videos").is_dir() and calibration_folder(path) is not None


def calibration_folder(path: Path) -> Path | None:
    """The folder of calibration files (its name starts with `calib`): in the trial or beside it."""
    for folder in (path, path.resolve().parent):
        found = sorted(folder.glob("[Cc]alib*")) if folder.is_dir() else []
        own = next((entry for entry in found if entry.is_dir()), None)
        if own is not None:
            return own
    return None


def _read_rig(folder: Path) -> CameraRig:
    for pattern, read in (("*.toml", read_calibration), ("*.qca.txt", read_qca)):
        files = sorted(folder.glob(pattern))
        if len(files) > 1:
            raise DatasetError(
                f"{folder}: several calibrations ({', '.join(file.name for file in files)}), "
                "expected one"
            )
        if files:
            return read(files[0])
    raise DatasetError(f"{folder}: no calibration, expected a *.toml or a Qualisys *.qca.txt")


def match_videos(folder: Path, rig: CameraRig) -> tuple[Mapping[str, Path], list[str]]:
    """Camera -> its video in a folder, by name, else all in order with a note that says so.

    Numbers in the videos' names count as numbers: cam2 comes before cam10.

    Raises:
        DatasetError: names differ, and so does the number of videos.
    """
    videos = sorted(
        (
            entry
            for entry in (folder.iterdir() if folder.is_dir() else ())
            if entry.suffix.lower() in VIDEO_SUFFIXES or (entry.is_dir() and numbered_files(entry))
        ),
        key=in_order,
    )
    by_stem = {video.stem: video for video in videos}
    if set(rig.names) <= set(by_stem):
        return {name: by_stem[name] for name in rig.names}, []
    if len(videos) != len(rig):
        raise DatasetError(
            f"{folder}: {len(videos)} videos "
            f"({', '.join(video.name for video in videos) or 'none'}), "
            f"expected one for each of {', '.join(rig.names)}"
        )
    pairs = dict(zip(rig.names, videos, strict=True))
    listed = ", ".join(f"{name} = {video.name}" for name, video in pairs.items())
    return pairs, [f"{folder}: names of videos and cameras differ, paired in order: {listed}"]


def _stretched(camera: CameraModel, size_px: tuple[int, int]) -> CameraModel:
    # Rows of K in proportion, as Pose2Sim (and references made with it) does; `CameraModel.resized`
    # would also shift the pixel centres, by less than 0.01 px here.
    matrix = camera.matrix.copy()
    matrix[0] *= size_px[0] / camera.size_px[0]
    matrix[1] *= size_px[1] / camera.size_px[1]
    return CameraModel(camera.name, size_px, matrix, camera.distortion, camera.T_cam_world)
