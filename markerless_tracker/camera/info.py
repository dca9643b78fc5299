"""Cameras as the fields of sensor_msgs/CameraInfo (REP-104), independent of a ROS library.

ROS and rosbags have message classes of their own with the same fields; both are filled from, and
read by, the functions here.
"""

from typing import Any

import numpy as np

from markerless_tracker.camera.model import CameraModel
from markerless_tracker.errors import CalibrationError
from markerless_tracker.geometry import FloatArray

WORLD_FRAME = "map"
"""Frame of the world (REP-105)."""

PLUMB_BOB = "plumb_bob"
"""Name in ROS of the radial-tangential lens model, the only one supported."""


def optical_frame(camera: str) -> str:
    """Frame of a camera's images (REP-103: x right, y down, z forward)."""
    return f"{camera}_optical_frame"


def info_fields(camera: CameraModel) -> dict[str, Any]:
    """Fields of the CameraInfo of a camera's unrectified images, without header and region.

    `width`, `height` in px, `distortion_model`, `d` (5,), `k` (9,), `r` (9,) = identity,
    `p` (12,) = [K 0]; matrices row by row.
    """
    width, height = camera.size_px
    return {
        "width": width,
        "height": height,
        "distortion_model": PLUMB_BOB,
        "d": camera.distortion.copy(),
        "k": camera.matrix.reshape(-1).copy(),
        "r": np.eye(3).reshape(-1),
        "p": np.hstack([camera.matrix, np.zeros((3, 1))]).reshape(-1),
    }


def camera_from_info(name: str, info: Any, T_cam_world: FloatArray, *, where: str) -> CameraModel:
    """The camera that a CameraInfo describes.

    Args:
        name: the camera's name.
        info: a CameraInfo; no coefficients, or zeros only, mean no distortion.
        T_cam_world: (4, 4), takes world points (m) to the camera's optical frame.
        where: the topic or bag, for messages.

    Raises:
        CalibrationError: uncalibrated, binned, cropped, or a lens model other than plumb_bob.
    """
    matrix = np.array(info.k, dtype=np.float64).reshape(3, 3)
    if not matrix[0, 0]:
        raise CalibrationError(f"{where}: K is zero (uncalibrated), expected a calibrated camera")
    coefficients = np.array(info.d, dtype=np.float64)
    if not coefficients.any():
        coefficients = np.zeros(5)
    elif info.distortion_model not in (PLUMB_BOB, "") or coefficients.size not in (4, 5):
        raise CalibrationError(
            f"{where}: distortion model {info.distortion_model!r} with {coefficients.size} "
            f"distortion coefficients is not supported, expected {PLUMB_BOB} with 4 or 5"
        )
    size_px = (int(info.width), int(info.height))
    region = (int(info.roi.width), int(info.roi.height))
    if info.binning_x > 1 or info.binning_y > 1 or region not in ((0, 0), size_px):
        raise CalibrationError(f"{where}: binning or a region of interest, expected full images")
    return CameraModel(name, size_px, matrix, coefficients, T_cam_world)
