"""Calibrated cameras: models, projection, calibration files."""

from markerless_tracker.camera.model import CameraModel, CameraRig, project, project_camera, scaled_size

__all__ = ["CameraModel", "CameraRig", "project", "project_camera", "scaled_size"]
