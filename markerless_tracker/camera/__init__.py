"""Calibrated cameras: models, projection, calibration files."""

from markerless_tracker.camera.calibration import read_calibration, read_qca, write_calibration
from markerless_tracker.camera.model import (
    CameraModel,
    CameraRig,
    project,
    project_camera,
    scaled_size,
)

__all__ = [
    "CameraModel",
    "CameraRig",
    "project",
    "project_camera",
    "read_calibration",
    "read_qca",
    "scaled_size",
    "write_calibration",
]
