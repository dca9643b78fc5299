"""sensor_msgs/CameraInfo and `CameraModel`."""

import numpy as np
from sensor_msgs.msg import CameraInfo

from markerless_tracker.camera import CameraModel
from markerless_tracker.errors import CalibrationError
from markerless_tracker.geometry import FloatArray
from markerless_tracker.node.ros.messages import header, optical_frame


def info_of(camera: CameraModel, stamp_ns: int) -> CameraInfo:
    """The CameraInfo (REP-104) of a camera's unrectified images."""
    message = CameraInfo(header=header(stamp_ns, optical_frame(camera.name)))
    message.width, message.height = camera.size_px
    message.distortion_model = "plumb_bob"
    message.d = camera.distortion.tolist()
    message.k = camera.matrix.ravel().tolist()
    message.r = np.eye(3).ravel().tolist()
    message.p = np.hstack([camera.matrix, np.zeros((3, 1))]).ravel().tolist()
    return message


def camera_of(name: str, info: CameraInfo, T_cam_world: FloatArray) -> CameraModel:
    """The camera that a CameraInfo describes, standing where it is said to.

    Binning and regions of interest are not supported.

    Raises:
        CalibrationError: uncalibrated, cropped, or a lens model other than plumb_bob; names the
            topic.
    """
    topic = f"{name}/camera_info"
    if not info.k[0]:
        raise CalibrationError(f"{topic}: K is zero (uncalibrated), expected a calibrated camera")
    if info.distortion_model not in ("plumb_bob", "") and any(info.d):
        raise CalibrationError(
            f"{topic}: distortion model {info.distortion_model!r} is not supported, "
            "expected plumb_bob"
        )
    if info.binning_x > 1 or info.binning_y > 1 or info.roi.width or info.roi.height:
        raise CalibrationError(f"{topic}: binning or a region of interest, expected full images")
    distortion = list(info.d) or [0.0] * 5
    matrix = np.array(info.k, dtype=np.float64).reshape(3, 3)
    return CameraModel(name, (info.width, info.height), matrix, np.array(distortion), T_cam_world)


def check_info(info: CameraInfo, camera: CameraModel) -> None:
    """Make sure that a CameraInfo is of the size that the calibration gives; size 0 says nothing.

    Raises:
        CalibrationError: it is of another; names the topic and both sizes.
    """
    width, height = camera.size_px
    if info.width and info.height and (info.width, info.height) != (width, height):
        raise CalibrationError(
            f"{camera.name}/camera_info: says {info.width}x{info.height} px, the calibration file "
            f"says {width}x{height} px; {camera.name} is ignored until they agree"
        )
