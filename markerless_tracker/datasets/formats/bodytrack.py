"""The layout of bodytrack (PARSEC): `CAM1/image0000.bmp`, `FG1/`, `CALIB/Camera1.cal`, start pose.

Recordings of the Lee walk can be given in the same layout, with a `ground_truth.trc`.
"""

import re
from pathlib import Path

from markerless_tracker.camera import CameraRig
from markerless_tracker.camera.cal_file import read_cal
from markerless_tracker.datasets.folder import VideoRecording
from markerless_tracker.datasets.formats.numbers import image_sizes, read_numbers
from markerless_tracker.datasets.video.images import image_number, numbered_files
from markerless_tracker.datasets.video.masks import read_mask
from markerless_tracker.errors import DatasetError
from markerless_tracker.geometry import FloatArray
from markerless_tracker.imaging import Image

FPS = 60.0
_CAMERA = re.compile(r"CAM(\d+)")
_POSE = 31
_POSITION = slice(3, 6)
"""Entries of a pose that are in mm: the position of the pelvis."""
_SHAPE = (10 * 4, 18)
"""Radii and scales of ten cones, lengths."""


class BodytrackRecording(VideoRecording):
    """A sequence in bodytrack's layout; cameras are named CAM1, ...

    Args:
        path: the folder.
        scale: factor for all images.
        input_fps: rate of the images, 1/s; without it 60, with a warning: no file states it.

    Raises:
        DatasetError: images are missing or cannot be read.
        CalibrationError: a `.cal` is missing or malformed.
    """

    def __init__(self, path: Path, *, scale: float = 1.0, input_fps: float | None = None) -> None:
        folders = {entry.name: entry for entry in sorted(path.glob("CAM*")) if entry.is_dir()}
        sources = {name: entry for name, entry in folders.items() if _CAMERA.fullmatch(name)}
        if not sources:
            raise DatasetError(f"{path}: no folder CAM1, CAM2, ... with images, expected them")
        sizes = image_sizes(sources)
        cameras = [
            read_cal(path / "CALIB" / f"Camera{name[3:]}.cal", name, sizes[name])
            for name in sources
        ]
        rig = CameraRig(tuple(cameras))
        super().__init__(
            path, sources, rig, scale=scale, input_fps=FPS if input_fps is None else input_fps
        )
        if input_fps is None:
            self.warn(f"{self.name}: no file states the rate, it is taken as {FPS:g} fps")

    def masks(self, camera: str) -> dict[int, Image]:
        """As of every recording; from `FG1/` for CAM1, whose images have the same numbers."""
        folder = self.path / f"FG{camera[3:]}"
        files = numbered_files(folder) if folder.is_dir() else []
        images = numbered_files(self._sources[camera])
        frames = {image_number(image): index for index, image in enumerate(images)}
        size_px = self.rig[camera].size_px
        return {
            frames[number]: read_mask(file, size_px)
            for file in files
            if (number := image_number(file)) in frames
        }

    def initial_pose(self) -> FloatArray | None:
        """(31,) the start pose of `InitialPose.txt`, rad and m; None without that file.

        Raises:
            DatasetError: the file is malformed.
        """
        path = self.path / "InitialPose.txt"
        if not path.is_file():
            return None
        pose = read_numbers(path, "the start pose", _POSE)
        pose[_POSITION] /= 1000.0
        return pose

    def body_shape(self) -> tuple[FloatArray, FloatArray] | None:
        """(10, 4) radii and scales, (18,) lengths of `BodyShapeParameters.txt`, in mm.

        Raises:
            DatasetError: the file is malformed.
        """
        path = self.path / "BodyShapeParameters.txt"
        if not path.is_file():
            return None
        values = read_numbers(path, "radii, scales and lengths", sum(_SHAPE))
        return values[: _SHAPE[0]].reshape(10, 4), values[_SHAPE[0] :]


def is_bodytrack(path: Path) -> bool:
    """Whether a folder has the layout."""
    return (path / "CALIB").is_dir() and (path / "CAM1").is_dir()
