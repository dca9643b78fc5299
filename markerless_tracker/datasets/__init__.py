"""Recordings and marker files: reading every supported format, writing ours."""

from markerless_tracker.datasets.background import read_background, read_background_models
from markerless_tracker.datasets.folder import FolderRecording
from markerless_tracker.datasets.markers.track import MarkerTrack
from markerless_tracker.datasets.markers.trc import format_trc, read_trc, write_trc
from markerless_tracker.datasets.pose2sim import Pose2SimRecording
from markerless_tracker.datasets.recording import FrameSet, Recording
from markerless_tracker.datasets.source import FORMATS, detect_format, open_recording
from markerless_tracker.datasets.target import new_folder
from markerless_tracker.datasets.truth import TRUTH, existing_truth, truth_path
from markerless_tracker.datasets.video.rates import every_for_fps, stamp_of, tidy_fps
from markerless_tracker.datasets.writer import (
    RecordingWriter,
    new_recording,
    write_background,
    write_image,
)

__all__ = [
    "FORMATS",
    "TRUTH",
    "FolderRecording",
    "FrameSet",
    "MarkerTrack",
    "Pose2SimRecording",
    "Recording",
    "RecordingWriter",
    "detect_format",
    "every_for_fps",
    "existing_truth",
    "format_trc",
    "new_folder",
    "new_recording",
    "open_recording",
    "read_background",
    "read_background_models",
    "read_trc",
    "stamp_of",
    "tidy_fps",
    "truth_path",
    "write_background",
    "write_image",
    "write_trc",
]
