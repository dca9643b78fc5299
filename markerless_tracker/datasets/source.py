"""Opening a recording of any supported format, detected or named."""

from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType

from markerless_tracker.datasets.folder import CALIBRATION, FolderRecording
from markerless_tracker.datasets.formats import anipose, caliscope, human36m, humaneva, totalcapture
from markerless_tracker.datasets.formats.anipose import AniposeRecording, is_anipose
from markerless_tracker.datasets.formats.bodytrack import BodytrackRecording, is_bodytrack
from markerless_tracker.datasets.formats.caliscope import CaliscopeRecording, is_caliscope
from markerless_tracker.datasets.formats.freemocap import FreeMoCapRecording, is_freemocap
from markerless_tracker.datasets.formats.human36m import Human36mRecording, is_human36m
from markerless_tracker.datasets.formats.humaneva import HumanEvaRecording, is_humaneva
from markerless_tracker.datasets.formats.mpi_inf_3dhp import MpiInf3dhpRecording, is_mpi_inf_3dhp
from markerless_tracker.datasets.formats.opencv import OpenCVRecording, is_opencv
from markerless_tracker.datasets.formats.panoptic import PanopticRecording, is_panoptic
from markerless_tracker.datasets.formats.totalcapture import TotalCaptureRecording, is_totalcapture
from markerless_tracker.datasets.pose2sim import (
    Pose2SimRecording,
    calibration_folder,
    is_pose2sim,
)
from markerless_tracker.datasets.recording import Recording
from markerless_tracker.datasets.upright.axes import upright
from markerless_tracker.datasets.upright.standing import PERSON, stand_upright
from markerless_tracker.datasets.video.images import VIDEO_SUFFIXES
from markerless_tracker.errors import DatasetError, TrackerError

_READERS: Mapping[str, Callable[..., Recording]] = MappingProxyType(
    {
        "folder": FolderRecording,
        "pose2sim": Pose2SimRecording,
        "humaneva": HumanEvaRecording,
        "bodytrack": BodytrackRecording,
        "anipose": AniposeRecording,
        "panoptic": PanopticRecording,
        "totalcapture": TotalCaptureRecording,
        "mpi_inf_3dhp": MpiInf3dhpRecording,
        "human36m": Human36mRecording,
        "freemocap": FreeMoCapRecording,
        "caliscope": CaliscopeRecording,
        "opencv": OpenCVRecording,
    }
)
"""Readers of videos and images by format."""
_SIGNS: Mapping[str, Callable[[Path], bool]] = MappingProxyType(
    {
        "folder": lambda path: (path / CALIBRATION).is_file(),
        "humaneva": is_humaneva,
        "bodytrack": is_bodytrack,
        "anipose": is_anipose,
        "panoptic": is_panoptic,
        "totalcapture": is_totalcapture,
        "mpi_inf_3dhp": is_mpi_inf_3dhp,
        "human36m": is_human36m,
        "freemocap": is_freemocap,
        "caliscope": is_caliscope,
        "pose2sim": is_pose2sim,
        "opencv": is_opencv,
    }
)
"""Whether a path has a format; the first that fits counts."""

_TRIALS: Mapping[str, Callable[[Path], list[Path]]] = MappingProxyType(
    {"humaneva": humaneva.trials, "anipose": anipose.trials, "human36m": human36m.trials}
)
"""Formats whose folders hold several trials: a source for each."""

FORMATS = (*_READERS, "bag")


def open_recording(
    path: str | Path,
    *,
    scale: float = 1.0,
    format: str | None = None,
    input_fps: float | None = None,
    up: str = "z",
    units: str = "m",
) -> Recording:
    """Open a recording folder, a bag (folder or `.mcap`) or a recording of another format.

    Args:
        path: the folder or file.
        scale: factor for all images and cameras, in (0, 1].
        format: one of `FORMATS`; None detects it.
        input_fps: rate of numbered images (and, if given, of videos), 1/s; a bag has its own.
        up: axis of the calibration's world that is up, such as `-y`; it becomes z. Reference
            markers, whose files have an axis that is up, stay as they are. `person` finds up from
            the cameras and the person, and moves the markers, too: see `stand_upright`.
        units: of the calibration's lengths: m, cm or mm.

    Raises:
        DatasetError: no supported format, or the recording is damaged.
        CalibrationError, ImageError, ConfigError: as documented by the reader of the format.
    """
    path = Path(path)
    if not path.exists():
        raise DatasetError(f"{path}: no such file or folder")
    kind = format or detect_format(path)
    recording: Recording
    if kind == "bag":
        # rosbags and mcap are slow to import, and only bags need them.
        from markerless_tracker.datasets.bag.recording import BagRecording

        recording = BagRecording(path, scale=scale)
    elif kind is not None and kind in _READERS:
        recording = _READERS[kind](path, scale=scale, input_fps=input_fps)
    elif format is not None:
        raise DatasetError(f"format {format!r}: expected one of {', '.join(FORMATS)}")
    else:
        entries = path.iterdir() if path.is_dir() else ()
        videos = [entry for entry in entries if entry.suffix.lower() in VIDEO_SUFFIXES]
        if len(videos) > 1:
            raise DatasetError(
                f"{path}: {len(videos)} videos, but no {CALIBRATION}, which `calibrate` makes"
            )
        raise DatasetError(
            f"{path}: no recording; expected a folder with {CALIBRATION} and videos, a bag (folder "
            f"or .mcap), or one of the formats {', '.join(_READERS)}"
        )
    recording.rig = upright(recording.rig, up="z" if up == PERSON else up, units=units)
    if up == PERSON:
        stand_upright(recording)
    return recording


def trials_at(path: Path) -> list[Path]:
    """The sources of the trials at a path that has a format: itself, unless there are several."""
    find = _TRIALS.get(detect_format(path) or "") if path.is_dir() else None
    try:
        found = [] if find is None else find(path)
    except TrackerError:
        # Opening it will say what is wrong.
        return [path]
    return found if len(found) > 1 else [path]


def session_folder(path: Path) -> Path:
    """The folder with the files of a trial that is named by one of them, else the path itself."""
    kind = detect_format(path)
    if kind == "humaneva":
        return humaneva.subject_folder(path)
    return path.parent.parent if kind in _TRIALS and path.is_file() else path


def calibration_beside(path: Path) -> Path | None:
    """A calibration outside of a recording's folder that it uses, file or folder; None without."""
    kind = detect_format(path)
    session = session_folder(path)
    if kind == "anipose":
        return anipose.calibration_file(session)
    if kind == "humaneva":
        return session / humaneva.CALIBRATION
    if kind == "human36m":
        return human36m.metadata_file(session)
    if kind == "totalcapture":
        return totalcapture.calibration_file(path)
    if kind == "caliscope":
        return caliscope.calibration_file(path)
    return calibration_folder(path) if kind == "pose2sim" else None


def detect_format(path: Path) -> str | None:
    """The format (one of `FORMATS`) of what is at a path, None if it has none of them."""
    if path.is_file() and path.suffix == ".mcap":
        return "bag"
    if (path / "metadata.yaml").is_file() or any(path.glob("*.mcap")):
        return "bag"
    return next((name for name, sign in _SIGNS.items() if sign(path)), None)
