"""ROS messages of a bag, from cameras and images (message types of rosbags, without ROS)."""

import struct
from dataclasses import replace
from functools import cache
from typing import Any

import cv2
import numpy as np
from rosbags.typesys import Stores, get_typestore
from scipy.spatial.transform import Rotation

from markerless_tracker.bags.pieces import Piece
from markerless_tracker.camera import CameraModel, CameraRig
from markerless_tracker.camera.ros_fields import WORLD_FRAME, camera_info_fields, optical_frame
from markerless_tracker.errors import DatasetError
from markerless_tracker.geometry import FloatArray
from markerless_tracker.imaging import Image

JPEG_QUALITY = 90
# Low PNG compression: higher levels take several times as long and save a few percent.
_FORMS = {
    "jpeg": (".jpg", [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY]),
    "png": (".png", [cv2.IMWRITE_PNG_COMPRESSION, 1]),
}
_IMAGES = ("sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage")
_NO_DATA = np.empty(0, np.uint8)

_PLAIN_QUATERNION = "MSG: geometry_msgs/Quaternion\nfloat64 x\nfloat64 y\nfloat64 z\nfloat64 w\n"
_QUATERNION = "MSG: geometry_msgs/Quaternion\nfloat64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1\n"


@cache
def typestore() -> Any:
    """The message types of Jazzy."""
    return get_typestore(Stores.ROS2_JAZZY)


def definition(kind: str) -> str:
    """The definition of a message type and of those in it, as rosbag2 stores it.

    rosbags leaves out default values; one of the types written has some.
    """
    text, _ = typestore().generate_msgdef(kind, ros_version=2)
    return str(text).replace(_PLAIN_QUATERNION, _QUATERNION)


def message_type(name: str) -> Any:
    """A message type by its name, such as std_msgs/msg/Header."""
    return typestore().types[name]


def serialized(message: Any, kind: str) -> tuple[Piece, ...]:
    """CDR of a message (of rosbags' types) in pieces; the data of an image are not copied."""
    if kind not in _IMAGES or message.data.dtype != np.uint8:
        return (typestore().serialize_cdr(message, kind),)
    # The data are the last field: their length, then the bytes.
    start = typestore().serialize_cdr(replace(message, data=_NO_DATA), kind)
    return bytes(start[:-4]) + struct.pack("=I", message.data.size), memoryview(message.data)


def stamp_message(stamp_ns: int) -> Any:
    """builtin_interfaces/Time of a stamp in ns."""
    return message_type("builtin_interfaces/msg/Time")(
        sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9
    )


def header(stamp_ns: int, frame: str) -> Any:
    """std_msgs/Header."""
    return message_type("std_msgs/msg/Header")(stamp=stamp_message(stamp_ns), frame_id=frame)


def image_message(image: Image, stamp_ns: int, camera: CameraModel) -> Any:
    """sensor_msgs/Image: bgr8 of (h, w, 3), mono8 of (h, w)."""
    height, width = image.shape[:2]
    return message_type("sensor_msgs/msg/Image")(
        header=header(stamp_ns, optical_frame(camera.name)),
        height=height,
        width=width,
        encoding="mono8" if image.ndim == 2 else "bgr8",
        is_bigendian=0,
        step=width * (1 if image.ndim == 2 else 3),
        data=np.ascontiguousarray(image).reshape(-1),
    )


def encoded_message(image: Image, stamp_ns: int, camera: CameraModel, form: str) -> Any:
    """sensor_msgs/CompressedImage: `jpeg` of quality `JPEG_QUALITY`, or lossless `png`.

    Raises:
        DatasetError: the image cannot be encoded.
    """
    suffix, options = _FORMS[form]
    done, data = cv2.imencode(suffix, image, options)
    if not done:
        raise DatasetError(f"{camera.name}: an image {image.shape} cannot be encoded as {form}")
    kind = "mono8" if image.ndim == 2 else "bgr8"
    # The format string of compressed_image_transport.
    words = f"{kind}; {form} compressed {'' if image.ndim == 2 else kind}".rstrip()
    return message_type("sensor_msgs/msg/CompressedImage")(
        header=header(stamp_ns, optical_frame(camera.name)), format=words, data=data.reshape(-1)
    )


def marker_poses_message(positions_m: FloatArray, stamp_ns: int) -> Any:
    """geometry_msgs/PoseArray of markers (m, 3) in m, world frame; NaN where one is unknown."""
    pose, point = message_type("geometry_msgs/msg/Pose"), message_type("geometry_msgs/msg/Point")
    upright = message_type("geometry_msgs/msg/Quaternion")(x=0.0, y=0.0, z=0.0, w=1.0)
    poses = [
        pose(position=point(x=x, y=y, z=z), orientation=upright) for x, y, z in positions_m.tolist()
    ]
    return message_type("geometry_msgs/msg/PoseArray")(
        header=header(stamp_ns, WORLD_FRAME), poses=poses
    )


def camera_info_message(camera: CameraModel, stamp_ns: int) -> Any:
    """sensor_msgs/CameraInfo of an unrectified camera: R = 1, P = [K 0], plumb_bob."""
    lists = camera_info_fields(camera)
    arrays = {name: np.array(lists.pop(name)) for name in ("d", "k", "r", "p")}
    return message_type("sensor_msgs/msg/CameraInfo")(
        header=header(stamp_ns, optical_frame(camera.name)),
        **lists,
        **arrays,
        binning_x=0,
        binning_y=0,
        roi=message_type("sensor_msgs/msg/RegionOfInterest")(
            x_offset=0, y_offset=0, height=0, width=0, do_rectify=False
        ),
    )


def static_transforms_message(rig: CameraRig, stamp_ns: int) -> Any:
    """tf2_msgs/TFMessage with `map` -> NAME_optical_frame of every camera."""
    vector, quaternion = (
        message_type("geometry_msgs/msg/Vector3"),
        message_type("geometry_msgs/msg/Quaternion"),
    )
    stamped, inner = (
        message_type("geometry_msgs/msg/TransformStamped"),
        message_type("geometry_msgs/msg/Transform"),
    )
    transforms = []
    for camera in rig:
        pose = camera.T_world_cam
        x, y, z, w = Rotation.from_matrix(pose[:3, :3]).as_quat(canonical=True).tolist()
        tx, ty, tz = (float(value) for value in pose[:3, 3])
        transforms.append(
            stamped(
                header=header(stamp_ns, WORLD_FRAME),
                child_frame_id=optical_frame(camera.name),
                transform=inner(
                    translation=vector(x=tx, y=ty, z=tz), rotation=quaternion(x=x, y=y, z=z, w=w)
                ),
            )
        )
    return message_type("tf2_msgs/msg/TFMessage")(transforms=transforms)
