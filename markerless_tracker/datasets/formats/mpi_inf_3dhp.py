"""MPI-INF-3DHP: a sequence with `camera.calibration`, `imageSequence/` and `annot.mat`."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from markerless_tracker.camera import CameraModel, CameraRig
from markerless_tracker.datasets.folder import VideoRecording
from markerless_tracker.datasets.formats.numbers import array_of
from markerless_tracker.datasets.markers.track import MarkerTrack
from markerless_tracker.datasets.upright.axes import upright, upright_points
from markerless_tracker.datasets.video.images import find_stream
from markerless_tracker.datasets.video.rates import stamp_of
from markerless_tracker.errors import CalibrationError, DatasetError
from markerless_tracker.geometry import FloatArray, apply, inverse, transform

CALIBRATION, IMAGES, ANNOTATIONS = "camera.calibration", "imageSequence", "annot.mat"
UP, UNITS = "y", "mm"
_VIDEO = re.compile(r"video_\d+")
JOINTS = (
    "spine3", "spine4", "spine2", "spine", "Pelvis", "Neck", "head", "Head", "left_clavicle",
    "LShoulder", "LElbow", "LWrist", "left_hand", "right_clavicle", "RShoulder", "RElbow", "RWrist",
    "right_hand", "LHip", "LKnee", "LAnkle", "left_foot", "left_toe", "RHip", "RKnee", "RAnkle",
    "right_foot", "right_toe",
)  # fmt: skip
"""The 28 joints in order, ours under our names: head_top is Head."""


class MpiInf3dhpRecording(VideoRecording):
    """A training sequence; cameras are named video_0, ..., world in m with z up.

    Read are `camera.calibration` (4 x 4 matrices; world to camera in mm, y up), the videos
    `imageSequence/video_0.avi` (or folders of images of that name) of as many cameras as there are,
    and, where it exists, `annot3` of `annot.mat` as reference markers.

    Args:
        path: the sequence's folder, such as S1/Seq1.
        scale: factor for all images.
        input_fps: rate of images (or another one of videos), 1/s.

    Raises:
        DatasetError: images are missing or cannot be read.
        CalibrationError: the calibration is malformed.
    """

    def __init__(self, path: Path, *, scale: float = 1.0, input_fps: float | None = None) -> None:
        cameras = read_cameras(path / CALIBRATION)
        found = {name: find_stream(path / IMAGES, name) for name in cameras}
        sources = {name: source for name, source in found.items() if source is not None}
        images = path / IMAGES
        videos = {entry.stem for entry in images.iterdir()} if images.is_dir() else set()
        unknown = sorted(name for name in videos if _VIDEO.fullmatch(name) and name not in cameras)
        if unknown:
            raise CalibrationError(
                f"{path / CALIBRATION}: no camera {', '.join(unknown)}, expected one for each video"
            )
        if not sources:
            raise DatasetError(f"{path / IMAGES}: no video_0.avi, video_1.avi, ..., expected them")
        self._stored = CameraRig(tuple(cameras[name] for name in sources))
        super().__init__(
            path,
            sources,
            upright(self._stored, up=UP, units=UNITS),
            scale=scale,
            input_fps=input_fps,
        )
        self.name = "_".join(path.resolve().parts[-2:])

    def _ground_truth(self) -> MarkerTrack | None:
        """The joints of `annot3`, those in the first camera's frame; None without `annot.mat`.

        Raises:
            DatasetError: the file is malformed.
        """
        file = self.path / ANNOTATIONS
        if not file.is_file():
            return super()._ground_truth()
        camera = next(iter(self._stored))
        joints_mm = _joints(file, int(camera.name.removeprefix("video_")))
        world = apply(inverse(camera.T_cam_world), joints_mm.reshape(-1, 3))
        stamps = np.array([stamp_of(frame, self.fps) for frame in range(len(joints_mm))])
        positions = upright_points(world.reshape(joints_mm.shape), up=UP, units=UNITS)
        return MarkerTrack(JOINTS, stamps, positions)


def is_mpi_inf_3dhp(path: Path) -> bool:
    """Whether a folder is a sequence."""
    return (path / CALIBRATION).is_file() and (path / IMAGES).is_dir()


def read_cameras(path: Path) -> dict[str, CameraModel]:
    """Name -> camera of a `camera.calibration`; world and mm as in the file.

    Of each camera the lines `name`, `size`, `intrinsic` and `extrinsic` (16 numbers each) are read;
    `radial` must be 0.

    Raises:
        CalibrationError: the file cannot be read or is malformed; names camera and field.
    """
    try:
        lines = path.read_text(encoding="ascii").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "not a text file"
        raise CalibrationError(f"{path}: cannot be read: {reason}") from error
    tables: dict[str, dict[str, Any]] = {}
    table: dict[str, Any] = {}
    for line in lines:
        words = line.split()
        if words[:1] == ["name"]:
            table = tables.setdefault(f"video_{words[1] if words[1:] else ''}", {})
        elif words:
            table[words[0]] = words[1:]
    if not tables:
        raise CalibrationError(f"{path}: no camera, expected lines `name 0`, ...")
    return {name: _camera(f"{path}: {name}", name, table) for name, table in tables.items()}


def _camera(where: str, name: str, table: Mapping[str, Any]) -> CameraModel:
    width, height = array_of(where, table, "size", (2,)).tolist()
    intrinsic = array_of(where, table, "intrinsic", (4, 4))
    extrinsic = array_of(where, table, "extrinsic", (4, 4))
    if table.get("radial", ["0"]) != ["0"]:
        raise CalibrationError(
            f"{where}: radial is {' '.join(table['radial'])}, expected 0: no distortion"
        )
    try:
        return CameraModel(
            name=name,
            size_px=(round(width), round(height)),
            matrix=intrinsic[:3, :3],
            distortion=np.zeros(5),
            T_cam_world=transform(extrinsic[:3, :3], extrinsic[:3, 3]),
        )
    except CalibrationError as error:
        raise CalibrationError(f"{where}: {error}") from error


def _joints(path: Path, camera: int) -> FloatArray:
    """(n, 28, 3) joints in mm in a camera's frame."""
    # Few recordings need it, and it takes a moment to import.
    from scipy.io import loadmat

    try:
        content: dict[str, Any] = loadmat(str(path))
    except Exception as error:  # damaged bytes raise any exception
        raise DatasetError(f"{path}: cannot be read as a MATLAB file: {error}") from error
    cells = np.asarray(content.get("annot3", []), dtype=object).ravel()
    if camera >= len(cells):
        raise DatasetError(
            f"{path}: annot3 has {len(cells)} cells, expected one for each camera up to {camera}"
        )
    try:
        values = np.asarray(cells[camera], dtype=np.float64)
        return values.reshape(len(values), len(JOINTS), 3)
    except (TypeError, ValueError) as error:
        raise DatasetError(
            f"{path}: annot3 of camera {camera} has shape {np.shape(cells[camera])}, expected "
            f"(frames, {3 * len(JOINTS)})"
        ) from error
