"""Conversion of results to ROS messages. Fields hold plain Python numbers."""

from collections.abc import Mapping
from importlib import import_module
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import Point, Pose, PoseArray, PoseWithCovarianceStamped, Quaternion
from sensor_msgs.msg import JointState
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker, MarkerArray

from markerless_tracker.body import BodyModel, cone_transforms, root_transform
from markerless_tracker.body.angles import ROOT_ANGLES, Angles
from markerless_tracker.camera.ros_fields import WORLD_FRAME
from markerless_tracker.geometry import FloatArray, quaternion_from_rotation
from markerless_tracker.node.health import Health, Level
from markerless_tracker.node.ros.stamps import time_message
from markerless_tracker.records import Confidence

_BODY_COLOUR = ColorRGBA(r=0.35, g=0.6, b=0.9, a=0.7)
_JOINT_COLOUR = ColorRGBA(r=1.0, g=0.45, b=0.1, a=1.0)
_JOINT_DIAMETER_M = 0.05
_LEVELS = {
    Level.OK: DiagnosticStatus.OK,
    Level.WARN: DiagnosticStatus.WARN,
    Level.STALE: DiagnosticStatus.STALE,
}


def message_class(kind: str) -> Any:
    """The class of a message type such as geometry_msgs/msg/PoseArray.

    Raises:
        ImportError, AttributeError: its package is not installed, or has no such message.
    """
    package, _, name = kind.replace("/msg/", "/").partition("/")
    return getattr(import_module(f"{package}.msg"), name)


def header(stamp_ns: int, frame: str = WORLD_FRAME) -> Header:
    """A header with the stamp of the images."""
    return Header(stamp=time_message(stamp_ns), frame_id=frame)


def joint_state(angles: Angles, stamp_ns: int) -> JointState:
    """All joint angles except the pelvis', named as in the body's URDF; rad."""
    return _joints(angles.names, angles.values_rad, stamp_ns)


def root_pose(
    body: BodyModel, pose: FloatArray, stamp_ns: int, confidence: Confidence | None = None
) -> PoseWithCovarianceStamped:
    """Pose of the body's root frame in the world; the covariance is zero if unknown."""
    message = PoseWithCovarianceStamped(header=header(stamp_ns))
    message.pose.pose = _pose(root_transform(body, pose))
    if confidence is not None:
        message.pose.covariance = confidence.root_covariance.ravel().tolist()
    return message


def joint_deviations(angles: Angles, stamp_ns: int) -> JointState:
    """Standard deviation of every joint angle, rad, in the field `position`; empty if unknown."""
    if angles.sd_rad is None:
        return JointState(header=header(stamp_ns, ""))
    return _joints(angles.names, angles.sd_rad, stamp_ns)


def marker_poses(markers_m: FloatArray, stamp_ns: int) -> PoseArray:
    """The 15 markers in order, world frame, identity orientation."""
    return PoseArray(
        header=header(stamp_ns), poses=[Pose(position=_point(row)) for row in markers_m]
    )


def body_markers(
    body: BodyModel, pose: FloatArray, markers_m: FloatArray, stamp_ns: int
) -> MarkerArray:
    """The body for viewers: a cylinder per cone (its mean radii) and a sphere per joint."""
    shapes = body.cone_shape.mean(axis=1)
    cylinders = []
    for number, T_world_cone in enumerate(cone_transforms(body, pose)):
        radius_x, radius_y, offset_x, offset_y = shapes[number].tolist()
        length = float(body.cone_length[number])
        T = np.vstack([T_world_cone, (0.0, 0.0, 0.0, 1.0)])
        T[:3, 3] += T[:3, :3] @ (offset_x, offset_y, length / 2.0)
        marker = Marker(header=header(stamp_ns), ns="body", id=number, type=Marker.CYLINDER)
        marker.pose = _pose(T)
        marker.scale.x, marker.scale.y, marker.scale.z = 2.0 * radius_x, 2.0 * radius_y, length
        marker.color = _BODY_COLOUR
        cylinders.append(marker)
    joints = Marker(header=header(stamp_ns), ns="joints", id=0, type=Marker.SPHERE_LIST)
    joints.pose.orientation.w = 1.0
    joints.scale.x = joints.scale.y = joints.scale.z = _JOINT_DIAMETER_M
    joints.color = _JOINT_COLOUR
    joints.points = [_point(row) for row in markers_m]
    return MarkerArray(markers=[*cylinders, joints])


def no_markers(stamp_ns: int) -> MarkerArray:
    """A message that deletes the body from viewers."""
    return MarkerArray(markers=[Marker(header=header(stamp_ns), action=Marker.DELETEALL)])


def state_message(
    name: str, values: Mapping[str, str], health: Health, stamp_ns: int
) -> DiagnosticArray:
    """A tracker's state.

    Args:
        name: the node's name with its namespace.
        values: of `TrackerStatus.values`.
        health: level and message.
        stamp_ns: time of the images of the last result, 0 before the first.
    """
    status = DiagnosticStatus(
        level=_LEVELS[health.level],
        name=f"{name.lstrip('/')}: tracking",
        message=health.message,
        hardware_id="markerless_tracker",
        values=[KeyValue(key=key, value=value) for key, value in values.items()],
    )
    return DiagnosticArray(header=header(stamp_ns, ""), status=[status])


def _joints(names: tuple[str, ...], values: FloatArray, stamp_ns: int) -> JointState:
    """A message of all joints except those of the root."""
    kept = [k for k, name in enumerate(names) if name not in ROOT_ANGLES]
    return JointState(
        header=header(stamp_ns, ""),
        name=[names[k] for k in kept],
        position=[float(values[k]) for k in kept],
    )


def _point(xyz: FloatArray) -> Point:
    x, y, z = (float(v) for v in xyz)
    return Point(x=x, y=y, z=z)


def _pose(T_world_x: FloatArray) -> Pose:
    w, x, y, z = (float(v) for v in quaternion_from_rotation(T_world_x[:3, :3]))
    return Pose(position=_point(T_world_x[:3, 3]), orientation=Quaternion(x=x, y=y, z=z, w=w))
