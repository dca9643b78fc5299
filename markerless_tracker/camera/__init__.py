"""Calibrated cameras: models, projection, calibration files, CameraInfo and TF without ROS."""

from markerless_tracker.camera.calibration import read_calibration, read_qca, write_calibration
from markerless_tracker.camera.info import (
    WORLD_FRAME,
    camera_from_info,
    info_fields,
    optical_frame,
)
from markerless_tracker.camera.model import (
    CameraModel,
    CameraRig,
    project,
    project_camera,
    scaled_size,
)
from markerless_tracker.camera.transforms import TransformTree, quaternion_xyzw

__all__ = [
    "WORLD_FRAME",
    "TransformTree",
    "camera_from_info",
    "info_fields",
    "optical_frame",
    "quaternion_xyzw",
    "CameraModel",
    "CameraRig",
    "project",
    "project_camera",
    "read_calibration",
    "read_qca",
    "scaled_size",
    "write_calibration",
]
