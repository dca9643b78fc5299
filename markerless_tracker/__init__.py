"""Full-body pose tracking from several calibrated cameras, with particle swarms.

The names in `__all__` are the public interface for Python programs:

- tracking: `build_tracker` makes a `TrackerSetup` with a `Tracker` from a `CameraRig` and a
  `TrackerConfig`; `Tracker.step(views, stamp_ns)` returns a `TrackResult`;
- cameras and backgrounds: `read_calibration`, `CameraModel`, `learn_background`;
- recordings: `open_recording`, `recording_backgrounds`, `track_recording`;
- markers and results: `read_trc`, `write_trc`, `MarkerTrack`, `ResultWriter`, `score`;
  `read_result` gives a `StoredResult`, named arrays over time.

They are imported at their first use, so that importing the package itself is fast.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from markerless_tracker.body import MARKER_NAMES as MARKER_NAMES
    from markerless_tracker.body import BodyModel as BodyModel
    from markerless_tracker.body import Subject as Subject
    from markerless_tracker.camera import CameraModel as CameraModel
    from markerless_tracker.camera import CameraRig as CameraRig
    from markerless_tracker.camera import read_calibration as read_calibration
    from markerless_tracker.camera import write_calibration as write_calibration
    from markerless_tracker.datasets import FrameSet as FrameSet
    from markerless_tracker.datasets import MarkerTrack as MarkerTrack
    from markerless_tracker.datasets import Recording as Recording
    from markerless_tracker.datasets import open_recording as open_recording
    from markerless_tracker.datasets import read_trc as read_trc
    from markerless_tracker.datasets import write_trc as write_trc
    from markerless_tracker.errors import BodyModelError as BodyModelError
    from markerless_tracker.errors import CalibrationError as CalibrationError
    from markerless_tracker.errors import ConfigError as ConfigError
    from markerless_tracker.errors import DatasetError as DatasetError
    from markerless_tracker.errors import ImageError as ImageError
    from markerless_tracker.errors import SearchError as SearchError
    from markerless_tracker.errors import TrackerError as TrackerError
    from markerless_tracker.imaging import BackgroundModel as BackgroundModel
    from markerless_tracker.imaging import learn_background as learn_background
    from markerless_tracker.records import Confidence as Confidence
    from markerless_tracker.records import LimbState as LimbState
    from markerless_tracker.records import Observation as Observation
    from markerless_tracker.records import TrackResult as TrackResult
    from markerless_tracker.records import TrackState as TrackState
    from markerless_tracker.results.read import read_result as read_result
    from markerless_tracker.results.result import ResultWriter as ResultWriter
    from markerless_tracker.results.run import TrackedFrame as TrackedFrame
    from markerless_tracker.results.run import recording_backgrounds as recording_backgrounds
    from markerless_tracker.results.run import track_recording as track_recording
    from markerless_tracker.results.score import Score as Score
    from markerless_tracker.results.score import score as score
    from markerless_tracker.results.stored_result import StoredResult as StoredResult
    from markerless_tracker.tracking import Tracker as Tracker
    from markerless_tracker.tracking import TrackerConfig as TrackerConfig
    from markerless_tracker.tracking import TrackerSetup as TrackerSetup
    from markerless_tracker.tracking import build_tracker as build_tracker

__version__ = "0.1.0"

_EXPORTS = {
    "body": ("MARKER_NAMES", "BodyModel", "Subject"),
    "camera": ("CameraModel", "CameraRig", "read_calibration", "write_calibration"),
    "datasets": ("FrameSet", "MarkerTrack", "Recording", "open_recording", "read_trc", "write_trc"),
    "errors": (
        "BodyModelError",
        "CalibrationError",
        "ConfigError",
        "DatasetError",
        "ImageError",
        "SearchError",
        "TrackerError",
    ),
    "imaging": ("BackgroundModel", "learn_background"),
    "records": ("Confidence", "LimbState", "Observation", "TrackResult", "TrackState"),
    "results.read": ("read_result",),
    "results.result": ("ResultWriter",),
    "results.run": ("TrackedFrame", "recording_backgrounds", "track_recording"),
    "results.score": ("Score", "score"),
    "results.stored_result": ("StoredResult",),
    "tracking": ("Tracker", "TrackerConfig", "TrackerSetup", "build_tracker"),
}
"""Public names by the module that defines them."""

_MODULES = {name: module for module, names in _EXPORTS.items() for name in names}

__all__ = ["__version__", *sorted(_MODULES)]


def __getattr__(name: str) -> Any:
    """Import a public name at its first use (PEP 562)."""
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
