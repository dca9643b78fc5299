"""Conversion between sensor_msgs/CameraInfo and `CameraModel`."""

import numpy as np
from sensor_msgs.msg import CameraInfo

from markerless_tracker.camera import CameraModel
from markerless_tracker.camera.ros_fields import camera_info_fields, lens_of, optical_frame
from markerless_tracker.errors import CalibrationError
from markerless_tracker.geometry import FloatArray
from markerless_tracker.node.ros.messages import header

TOLERANCE = 0.01
"""K and D of a camera info may differ by this fraction from the calibration file."""


def info_of(camera: CameraModel, stamp_ns: int) -> CameraInfo:
    """The CameraInfo (REP-104) of a camera's unrectified images."""
    return CameraInfo(
        header=header(stamp_ns, optical_frame(camera.name)), **camera_info_fields(camera)
    )


FIRST_INFO = "the first camera info"
"""Name of the reference calibration if the rig comes from camera infos."""


def camera_of(name: str, info: CameraInfo, T_cam_world: FloatArray, topic: str) -> CameraModel:
    """The camera that a CameraInfo describes.

    Args:
        name: of the camera.
        info: the message.
        T_cam_world: (4, 4), takes world points to the camera.
        topic: of the message, for error messages.

    Raises:
        CalibrationError: uncalibrated, cropped, or a lens model other than plumb_bob; names the
            topic.
    """
    matrix, distortion = lens_of(info, topic)
    try:
        return CameraModel(name, (info.width, info.height), matrix, distortion, T_cam_world)
    except CalibrationError as error:
        raise CalibrationError(f"{topic}: {error}") from error


def check_info(
    info: CameraInfo,
    camera: CameraModel,
    topic: str,
    reference: str = "the calibration file",
) -> str:
    """Compare a CameraInfo with the calibration in use.

    A size of 0 and a K and D of zeros (uncalibrated) are not compared.

    Args:
        info: the message.
        camera: the calibration in use.
        topic: of the message, for error messages.
        reference: source of the calibration in use, in words.

    Returns:
        The differences of K and D of more than `TOLERANCE`, in one line; empty if there are none.

    Raises:
        CalibrationError: the calibration cannot be that of the images: another size, another lens
            model, binning or a region of interest, or K or D is not finite.
    """
    ignored = f"; {camera.name} is left out until it is right"
    width, height = camera.size_px
    if info.width and info.height and (info.width, info.height) != (width, height):
        raise CalibrationError(
            f"{topic}: says {info.width}x{info.height} px, {reference} says "
            f"{width}x{height} px{ignored}"
        )
    if not np.any(info.k) and not np.any(info.d):
        return ""
    try:
        matrix, distortion = lens_of(info, topic)
    except CalibrationError as error:
        raise CalibrationError(f"{error}{ignored}") from error
    notes = []
    if np.abs(matrix - camera.matrix).max() > TOLERANCE * camera.matrix[[0, 1], [0, 1]].min():
        notes.append(_difference("K", matrix[:2].ravel(), camera.matrix[:2].ravel(), reference))
    if np.abs(distortion - camera.distortion).max() > TOLERANCE * max(
        np.abs(camera.distortion).max(), TOLERANCE
    ):
        notes.append(_difference("D", distortion, camera.distortion, reference))
    if not notes:
        return ""
    restart = " until the tracker is restarted" if reference == FIRST_INFO else ""
    return f"{topic}: {', '.join(notes)}; {reference} is used{restart}"


def _difference(name: str, came: FloatArray, expected: FloatArray, reference: str) -> str:
    listed = [" ".join(f"{value:.5g}" for value in values) for values in (came, expected)]
    return f"{name} is [{listed[0]}], {reference} says [{listed[1]}]"
