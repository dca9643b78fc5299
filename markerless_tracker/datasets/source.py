"""Opening a recording of any supported format, detected or named."""

from pathlib import Path

from markerless_tracker.datasets.folder import CALIBRATION, FolderRecording
from markerless_tracker.datasets.pose2sim import Pose2SimRecording, calibration_folder
from markerless_tracker.datasets.recording import Recording
from markerless_tracker.errors import DatasetError

FORMATS = ("folder", "pose2sim", "bag")


def open_recording(
    path: str | Path,
    *,
    scale: float = 1.0,
    format: str | None = None,
    input_fps: float | None = None,
) -> Recording:
    """Open a recording folder, a Pose2Sim project or a bag (folder or `.mcap`).

    Args:
        path: the folder or file.
        scale: factor for all images and cameras, in (0, 1].
        format: one of `FORMATS`; None detects it.
        input_fps: rate of numbered images (and, if given, of videos), 1/s.

    Raises:
        DatasetError: no supported format, or the recording is damaged.
        CalibrationError, ImageError, ConfigError: as documented by the reader of the format.
    """
    path = Path(path)
    if not path.exists():
        raise DatasetError(f"{path}: no such file or folder")
    kind = format or detect_format(path)
    if kind == "bag":
        # rosbags and mcap are slow to import, and only bags need them.
        from markerless_tracker.datasets.bag.recording import BagRecording

        return BagRecording(path, scale=scale)
    if kind == "folder":
        return FolderRecording(path, scale=scale, input_fps=input_fps)
    if kind == "pose2sim":
        return Pose2SimRecording(path, scale=scale, input_fps=input_fps)
    if format is not None:
        raise DatasetError(f"format {format!r}: expected one of {', '.join(FORMATS)}")
    raise DatasetError(
        f"{path}: no recording; expected a folder with {CALIBRATION} and videos, a Pose2Sim "
        "project (videos/ and calibration/), or a bag (folder or .mcap)"
    )


def detect_format(path: Path) -> str | None:
    """The format (one of `FORMATS`) of what is at a path, None if it has none of them."""
    if path.is_file():
        return "bag" if path.suffix == ".mcap" else None
    if (path / "metadata.yaml").is_file() or any(path.glob("*.mcap")):
        return "bag"
    if (path / CALIBRATION).is_file():
        return "folder"
    if (path / "videos").is_dir() and calibration_folder(path) is not None:
        return "pose2sim"
    return None
