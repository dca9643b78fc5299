"""Caliscope: `recordings/TRIAL/cam_0.mp4`, ... and the workspace's `camera_array.toml`."""

import csv
import math
import re
import tomllib
from pathlib import Path
from typing import Any

import numpy as np

from markerless_tracker.camera import CameraModel, CameraRig
from markerless_tracker.datasets.folder import VideoRecording
from markerless_tracker.datasets.formats.numbers import array_of, count_of
from markerless_tracker.datasets.video.images import find_stream
from markerless_tracker.errors import CalibrationError, DatasetError
from markerless_tracker.geometry import rotation_from_rodrigues, transform

CAMERAS, TIMES = "camera_array.toml", "timestamps.csv"
_VOLUME = Path("calibration", "extrinsic", "capture_volume")
_VIDEO = re.compile(r"cam_(\d+)")


class CaliscopeRecording(VideoRecording):
    """A recording of a Caliscope workspace; cameras are named cam_0, ...

    Read are the videos, and `camera_array.toml` beside them or in the workspace's
    `calibration/extrinsic/capture_volume/` (pixels, m; rotations as vectors or matrices). Cameras
    without a pose, or marked `ignore`, are left out. The world is that of the calibration.

    Args:
        path: the folder of the videos.
        scale: factor for all images.
        input_fps: another rate, 1/s.

    Raises:
        DatasetError: videos are missing or cannot be read, or `timestamps.csv` says that the
            cameras are not in step.
        CalibrationError: the calibration is missing or malformed.
    """

    def __init__(self, path: Path, *, scale: float = 1.0, input_fps: float | None = None) -> None:
        file = calibration_file(path)
        if file is None:
            raise CalibrationError(f"{path}: no {CAMERAS} here or in {_VOLUME} of the workspace")
        cameras, without = read_cameras(file)
        known = {*without, *(camera.name for camera in cameras)}
        unknown = [name for name in _videos(path) if name not in known]
        if unknown:
            raise CalibrationError(
                f"{file}: no table of {', '.join(unknown)}, expected one for each video"
            )
        found = {camera.name: find_stream(path, camera.name) for camera in cameras}
        sources = {name: source for name, source in found.items() if source is not None}
        if not sources:
            raise DatasetError(f"{path}: no video of {', '.join(found)}, expected cam_0.mp4, ...")
        rig = CameraRig(tuple(camera for camera in cameras if camera.name in sources))
        super().__init__(path, sources, rig, scale=scale, input_fps=input_fps)
        if without:
            self.warn(f"{file}: {', '.join(without)} left out: no pose, or marked `ignore`")
        missing = [name for name in found if name not in sources]
        if missing:
            self.warn(f"{path}: {', '.join(missing)} left out: calibrated, but no video")
        _check_times(path / TIMES, rig.names)


def is_caliscope(path: Path) -> bool:
    """Whether a folder has videos cam_0, ... and a calibration of Caliscope."""
    if not path.is_dir() or calibration_file(path) is None:
        return False
    return bool(_videos(path))


def _videos(path: Path) -> list[str]:
    """Names of the cameras that have videos."""
    entries = sorted(path.iterdir()) if path.is_dir() else []
    found = (entry.stem for entry in entries if _VIDEO.fullmatch(entry.stem))
    return list(dict.fromkeys(found))


def calibration_file(path: Path) -> Path | None:
    """The calibration of a recording: beside its videos, or of its workspace."""
    folder = path.resolve()
    places = (folder / CAMERAS, folder.parent.parent / _VOLUME / CAMERAS)
    return next((place for place in places if place.is_file()), None)


def read_cameras(path: Path) -> tuple[list[CameraModel], list[str]]:
    """Read a `camera_array.toml`: the cameras, and the names of those without a pose or ignored.

    Raises:
        CalibrationError: the file cannot be read or is malformed; names camera and field.
    """
    try:
        tables: Any = tomllib.loads(path.read_text(encoding="utf-8")).get("cameras")
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise CalibrationError(f"{path}: cannot be read: {error}") from error
    if not isinstance(tables, dict) or not tables:
        raise CalibrationError(f"{path}: no tables [cameras.0], ..., expected one for each camera")
    cameras, without = [], []
    for key, table in tables.items():
        name, where = f"cam_{key}", f"{path}: cam_{key}"
        if not isinstance(table, dict):
            raise CalibrationError(f"{where}: {table!r}, expected a table")
        if table.get("ignore") is True or "rotation" not in table or "translation" not in table:
            without.append(name)
            continue
        if table.get("fisheye") is True:
            raise CalibrationError(
                f"{where}: fisheye lenses are not supported, expected fisheye = false"
            )
        size = array_of(where, table, "size", (2,))
        flat = count_of(table, "rotation") == 3
        rotation = array_of(where, table, "rotation", (3,) if flat else (3, 3))
        distortion = array_of(where, table, "distortions", (count_of(table, "distortions") or 5,))
        try:
            cameras.append(
                CameraModel(
                    name=name,
                    size_px=(round(size[0]), round(size[1])),
                    matrix=array_of(where, table, "matrix", (3, 3)),
                    distortion=distortion,
                    T_cam_world=transform(
                        rotation_from_rodrigues(rotation) if flat else rotation,
                        array_of(where, table, "translation", (3,)),
                    ),
                )
            )
        except CalibrationError as error:
            text = str(error)
            raise CalibrationError(text if text.startswith(where) else f"{path}: {text}") from error
    if not cameras:
        raise CalibrationError(f"{path}: no camera with rotation and translation, expected some")
    return cameras, without


def _check_times(path: Path, names: tuple[str, ...]) -> None:
    """Make sure that frames of one number were taken at one time, within half a frame."""
    if not path.is_file():
        return
    times: dict[str, list[float]] = {}
    try:
        with path.open(encoding="utf-8", newline="") as file:
            for row in csv.DictReader(file):
                time_s = float(row["frame_time"])
                if not math.isfinite(time_s):
                    raise ValueError(f"frame_time is {row['frame_time']!r}")
                times.setdefault(f"cam_{int(row['cam_id'])}", []).append(time_s)
    except (OSError, UnicodeDecodeError, KeyError, TypeError, ValueError, csv.Error) as error:
        raise DatasetError(
            f"{path}: cannot be read ({type(error).__name__}: {error}), expected columns cam_id "
            "and frame_time"
        ) from error
    missing = [name for name in names if name not in times]
    if missing:
        raise DatasetError(f"{path}: no times of {', '.join(missing)}")
    length = min(len(times[name]) for name in names)
    each = np.array([sorted(times[name])[:length] for name in names])
    if length < 2:
        return
    off = np.abs(each - each[0]).max(axis=0)
    half = 0.5 * float(np.median(np.diff(each, axis=1)))
    if (off > half).any():
        frame = int(np.argmax(off > half))
        camera = names[int(np.argmax(np.abs(each[:, frame] - each[0, frame])))]
        raise DatasetError(
            f"{path}: frame {frame} of {camera} is {1000.0 * off[frame]:.0f} ms off that of "
            f"{names[0]}, expected cameras in step within half a frame; write synchronised videos "
            "first"
        )
