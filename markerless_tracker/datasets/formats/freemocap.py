"""FreeMoCap: a recording with `synchronized_videos/` and `*_camera_calibration.toml`."""

import csv
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from markerless_tracker.camera import CameraModel, CameraRig, read_calibration
from markerless_tracker.datasets.folder import VideoRecording
from markerless_tracker.datasets.formats.numbers import read_json
from markerless_tracker.datasets.pose2sim import match_videos
from markerless_tracker.datasets.upright.axes import upright
from markerless_tracker.datasets.video.rates import tidy_fps
from markerless_tracker.errors import CalibrationError, DatasetError

VIDEOS = "synchronized_videos"
UNITS = "mm"
_CALIBRATION = "*_camera_calibration.toml"
_RATE = "from_previous.framerate.hz"
"""Column of the rates in the file of time stamps."""
_LEAST = 10
"""Rows of time stamps from which a rate is taken."""


class FreeMoCapRecording(VideoRecording):
    """A recording folder of FreeMoCap; world in m, as the calibration has it.

    Read are `NAME_camera_calibration.toml` (in Anipose's format, mm) and the videos in
    `synchronized_videos/`: those that `NAME_recording_info.json` names for the cameras, else by
    name, else in order. The rate is that of its time stamps, where it has any: those of the video
    files differ from camera to camera. A camera named by a number N is called cam_N.

    Args:
        path: the recording's folder.
        scale: factor for all images.
        input_fps: another rate, 1/s.

    Raises:
        DatasetError: videos are missing or cannot be read.
        CalibrationError: the calibration is missing, malformed, or there are several.
    """

    def __init__(self, path: Path, *, scale: float = 1.0, input_fps: float | None = None) -> None:
        files = sorted(path.glob(_CALIBRATION))
        if len(files) != 1:
            raise CalibrationError(
                f"{path}: calibrations {', '.join(file.name for file in files) or 'none'}, "
                f"expected one {_CALIBRATION}"
            )
        stored = read_calibration(files[0])
        named = _named_videos(path, stored)
        videos, notes = (named, []) if named else match_videos(path / VIDEOS, stored)
        names = {name: f"cam_{name}" if name.isdecimal() else name for name in stored.names}
        cameras = [
            CameraModel(names[c.name], c.size_px, c.matrix, c.distortion, c.T_cam_world)
            for c in stored
        ]
        super().__init__(
            path,
            {names[name]: video for name, video in videos.items()},
            upright(CameraRig(tuple(cameras)), units=UNITS),
            scale=scale,
            input_fps=_rate(path / VIDEOS) if input_fps is None else input_fps,
        )
        for note in notes:
            self.warn(note)


def is_freemocap(path: Path) -> bool:
    """Whether a folder is a recording with a calibration."""
    return (path / VIDEOS).is_dir() and any(path.glob(_CALIBRATION))


def _named_videos(path: Path, rig: CameraRig) -> Mapping[str, Path]:
    """Camera -> the video that the recording's description names; {} without one."""
    for kind in ("recording_info", "info"):
        file = path / f"{path.resolve().name}_{kind}.json"
        videos = read_json(file).get("videos") if file.is_file() else None
        if not isinstance(videos, dict) or not videos:
            continue
        missing = [name for name in rig.names if not isinstance(videos.get(name), str)]
        if missing:
            raise DatasetError(f"{file}: videos: no file of {', '.join(missing)}")
        found = {name: path / VIDEOS / str(videos[name]) for name in rig.names}
        absent = [video for video in found.values() if not video.is_file()]
        if absent:
            raise DatasetError(f"{absent[0]}: no such video, named in {file.name}")
        return found
    return {}


def _rate(folder: Path) -> float | None:
    """The median rate of the time stamps, 1/s; None without any."""
    for file in sorted((folder / "timestamps").rglob("*stats.json")):
        try:
            median = json.loads(file.read_text(encoding="utf-8"))["framerate_stats"]["median"]
        except (OSError, ValueError, KeyError, TypeError):
            # Some releases leave it empty.
            continue
        if _is_rate(median):
            return tidy_fps(float(median))
    for file in sorted((folder / "timestamps").rglob("*timestamps.csv")):
        rates = _rates(file)
        if len(rates) >= _LEAST:
            return tidy_fps(float(np.median(rates)))
    return None


def _rates(file: Path) -> list[float]:
    try:
        with file.open(encoding="utf-8", newline="") as rows:
            words = [row.get(_RATE) or "" for row in csv.DictReader(rows)]
        values = [float(word) for word in words if word]
    except (OSError, UnicodeDecodeError, ValueError, csv.Error) as error:
        raise DatasetError(f"{file}: {_RATE}: {error}, expected numbers") from error
    return [value for value in values if _is_rate(value)]


def _is_rate(value: Any) -> bool:
    return isinstance(value, int | float) and 0.0 < value < 1e4
