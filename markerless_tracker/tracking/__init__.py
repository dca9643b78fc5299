"""The tracker: configuration, stages of a frame, state, `Tracker.step`."""

from markerless_tracker.tracking.config import OPTIMIZERS, PRESETS, TrackerConfig
from markerless_tracker.tracking.evidence.prepared import Prepared
from markerless_tracker.tracking.setup import TrackerSetup, build_tracker
from markerless_tracker.tracking.tracker import Tracker

__all__ = [
    "OPTIMIZERS",
    "PRESETS",
    "Prepared",
    "Tracker",
    "TrackerConfig",
    "TrackerSetup",
    "build_tracker",
]
