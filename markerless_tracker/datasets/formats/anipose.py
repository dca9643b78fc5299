"""Anipose: a session with `calibration/calibration.toml` and videos named by trial and camera."""

import re
import tomllib
from pathlib import Path
from typing import Any

from markerless_tracker.camera import CameraRig, read_calibration
from markerless_tracker.datasets.folder import CALIBRATION, VideoRecording
from markerless_tracker.datasets.video.images import VIDEO_SUFFIXES
from markerless_tracker.errors import DatasetError

_FOLDERS = ("videos-raw", "videos")
_CALIBRATION = "calibration"
_CONFIG = "config.toml"
_UP = 4
"""Folders above a session in which its `config.toml` is looked for."""


class AniposeRecording(VideoRecording):
    """A trial of an Anipose session.

    The videos are in `videos-raw/`, or in `videos/` if the format is named: a session with that
    folder is detected as a Pose2Sim project. `triangulation.cam_regex` of the project's
    `config.toml` matches the camera's name in a video's name; without it, the video's name ends
    with the camera's. The world is that of the calibration.

    Args:
        path: the session's folder, or one video of the trial.
        scale: factor for all images.
        input_fps: another rate, 1/s.

    Raises:
        DatasetError: no trial or several, a camera has no video, or the config is malformed.
        CalibrationError: the calibration is missing or malformed.
    """

    def __init__(self, path: Path, *, scale: float = 1.0, input_fps: float | None = None) -> None:
        session = path.parent.parent if path.is_file() else path
        rig = read_calibration(calibration_file(session))
        trials = _trials(session, rig)
        if path.is_file():
            chosen = [name for name, videos in trials.items() if path in videos.values()]
        else:
            chosen = list(trials)
        if len(chosen) != 1:
            raise DatasetError(
                f"{path}: trials {', '.join(chosen) or 'none'}, expected videos of one trial of "
                f"the cameras {', '.join(rig.names)}, or one video of the trial as the source"
            )
        sources = trials[chosen[0]]
        missing = [name for name in rig.names if name not in sources]
        if missing:
            raise DatasetError(
                f"{session}: trial {chosen[0]!r} has no video of {', '.join(missing)}, expected "
                "one of each calibrated camera"
            )
        super().__init__(session, sources, rig, scale=scale, input_fps=input_fps)
        if chosen[0]:
            self.name = f"{self.name}_{chosen[0]}"


def is_anipose(path: Path) -> bool:
    """Whether a path is a session, or a video of one."""
    if path.is_file():
        if path.parent.name not in _FOLDERS or path.suffix.lower() not in VIDEO_SUFFIXES:
            return False
        path = path.parent.parent
    return (path / _FOLDERS[0]).is_dir() and calibration_file(path).is_file()


def trials(path: Path) -> list[Path]:
    """One video of each trial of a session.

    Raises:
        CalibrationError, DatasetError: as `AniposeRecording` does.
    """
    found = _trials(path, read_calibration(calibration_file(path)))
    return [next(iter(videos.values())) for videos in found.values()]


def calibration_file(session: Path) -> Path:
    """The calibration of a session: its own, or that beside it; whether it exists or not."""
    own = session / _CALIBRATION / CALIBRATION
    return own if own.is_file() else session.parent / _CALIBRATION / CALIBRATION


def _trials(session: Path, rig: CameraRig) -> dict[str, dict[str, Path]]:
    """Trial -> camera -> video."""
    pattern = _pattern(session)
    folder = next((session / name for name in _FOLDERS if (session / name).is_dir()), session)
    trials: dict[str, dict[str, Path]] = {}
    for video in sorted(folder.iterdir()):
        if video.suffix.lower() not in VIDEO_SUFFIXES:
            continue
        if pattern is not None:
            match = pattern.search(video.stem)
            camera = match[1].strip() if match and match[1] else None
            trial = pattern.sub("", video.stem).strip()
        else:
            ends = [name for name in rig.names if video.stem.endswith(name)]
            camera = max(ends, key=len, default=None)
            trial = video.stem.removesuffix(camera or "").rstrip("-_. ")
        if camera in rig.names:
            trials.setdefault(trial, {})[str(camera)] = video
    return trials


def _pattern(session: Path) -> re.Pattern[str] | None:
    """The pattern of the cameras' names, None without one."""
    for folder in (session, *session.resolve().parents[:_UP]):
        path = folder / _CONFIG
        if not path.is_file():
            continue
        try:
            config: dict[str, Any] = tomllib.loads(path.read_text(encoding="utf-8"))
        except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
            raise DatasetError(f"{path}: cannot be read: {error}") from error
        table = config.get("triangulation", {})
        if not isinstance(table, dict):
            raise DatasetError(f"{path}: triangulation is {table!r}, expected a table")
        text = table.get("cam_regex")
        if text is None:
            continue
        try:
            pattern = re.compile(text)
        except (re.error, TypeError) as error:
            raise DatasetError(
                f"{path}: triangulation.cam_regex is {text!r}, expected a pattern ({error})"
            ) from error
        if pattern.groups < 1:
            raise DatasetError(
                f"{path}: triangulation.cam_regex is {text!r}, expected one group, the camera"
            )
        return pattern
    return None
