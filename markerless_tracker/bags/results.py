"""A result as an MCAP bag folder: the topics that the node publishes."""

from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from markerless_tracker.bags.mcap_bag import BagWriter, check_stamp
from markerless_tracker.bags.messages import (
    header,
    marker_poses_message,
    message_type,
)
from markerless_tracker.body import BodyModel, root_transform
from markerless_tracker.body.angles import ROOT_ANGLES
from markerless_tracker.body.urdf import urdf
from markerless_tracker.camera.ros_fields import WORLD_FRAME
from markerless_tracker.datasets.target import new_folder
from markerless_tracker.errors import DatasetError
from markerless_tracker.geometry import FloatArray
from markerless_tracker.results.read import ResultReader
from markerless_tracker.results.stored_result import StoredResult

_NODE = "tracker"


def write_result_bag(out: Path, reader: ResultReader, *, replace: bool = False) -> int:
    """Write a result as a bag folder, in the world frame `map` (Z up, as in REP-103).

    Topics: `/marker_poses`, `/joint_states`, `/joint_deviations`, `/root_pose`, `/tf` (`map` to the
    body's root) and, once, the latched `/robot_description`. `/state` has one message per frame,
    the other topics only for frames with a pose.

    Args:
        out: the new folder.
        reader: the result.
        replace: whether an earlier bag is replaced.

    Returns:
        Number of messages.

    Raises:
        DatasetError: the folder exists or cannot be written, or a stamp does not fit in a message.
        BodyModelError: the result's body is unknown.
    """
    body = reader.body()
    with new_folder(out, replace=replace) as folder:
        with BagWriter(folder) as writer:
            topics = _Topics(writer, body, reader.angle_names)
            for part in reader.chunks():
                for row, stamp in enumerate(part.stamps_ns.tolist()):
                    check_stamp(stamp, str(reader.name))
                    topics.state(stamp, str(part.states[row]), float(part.fitness[row]))
                    topics.pose(stamp, part.parameters[row])
                    topics.joints(stamp, part, row)
                    topics.markers(stamp, part.positions_m[row])
            if not writer.messages:
                raise DatasetError(f"{reader.name}: has no frame, expected at least one")
        return writer.messages


class _Topics:
    """The topics of a bag being written."""

    def __init__(self, writer: BagWriter, body: BodyModel, angles: tuple[str, ...]) -> None:
        self._writer, self._body = writer, body
        # The joints of the URDF: the reported angles, if there are any, except the root's.
        self._columns = [k for k, name in enumerate(angles) if name not in ROOT_ANGLES]
        self._angles = [angles[column] for column in self._columns]
        kinds = {
            "/robot_description": "std_msgs/msg/String",
            "/state": "diagnostic_msgs/msg/DiagnosticArray",
            "/marker_poses": "geometry_msgs/msg/PoseArray",
            "/joint_states": "sensor_msgs/msg/JointState",
            "/joint_deviations": "sensor_msgs/msg/JointState",
            "/root_pose": "geometry_msgs/msg/PoseWithCovarianceStamped",
            "/tf": "tf2_msgs/msg/TFMessage",
        }
        self._topics = {
            name: writer.topic(name, kind, latched=name == "/robot_description")
            for name, kind in kinds.items()
        }

    def state(self, stamp: int, state: str, fitness: float) -> None:
        """Write the state of a frame; before the first, the body's description."""
        if not self._writer.messages:
            text = message_type("std_msgs/msg/String")(data=urdf(self._body))
            self._put("/robot_description", stamp, text)
        pair = message_type("diagnostic_msgs/msg/KeyValue")
        tracked = state == "TRACKING"
        status = message_type("diagnostic_msgs/msg/DiagnosticStatus")(
            level=0 if tracked else 1,
            name=f"{_NODE}: tracking",
            message=state,
            hardware_id="markerless_tracker",
            values=[pair(key="state", value=state), pair(key="fitness", value=f"{fitness:.6g}")],
        )
        array = message_type("diagnostic_msgs/msg/DiagnosticArray")
        self._put("/state", stamp, array(header=header(stamp, ""), status=[status]))

    def pose(self, stamp: int, parameters: FloatArray) -> None:
        """Write a pose (p,), if it is known."""
        if not np.isfinite(parameters).all():
            return
        T = root_transform(self._body, parameters)
        x, y, z = (float(value) for value in T[:3, 3])
        quaternion = message_type("geometry_msgs/msg/Quaternion")(
            *Rotation.from_matrix(T[:3, :3]).as_quat(canonical=True).tolist()
        )
        pose = message_type("geometry_msgs/msg/Pose")(
            position=message_type("geometry_msgs/msg/Point")(x=x, y=y, z=z), orientation=quaternion
        )
        stamped = message_type("geometry_msgs/msg/PoseWithCovarianceStamped")(
            header=header(stamp, WORLD_FRAME),
            # The file has no covariance of the root; zero means unknown.
            pose=message_type("geometry_msgs/msg/PoseWithCovariance")(
                pose=pose, covariance=np.zeros(36)
            ),
        )
        self._put("/root_pose", stamp, stamped)
        transform = message_type("geometry_msgs/msg/TransformStamped")(
            header=header(stamp, WORLD_FRAME),
            child_frame_id=self._body.root_frame,
            transform=message_type("geometry_msgs/msg/Transform")(
                translation=message_type("geometry_msgs/msg/Vector3")(x=x, y=y, z=z),
                rotation=quaternion,
            ),
        )
        self._put("/tf", stamp, message_type("tf2_msgs/msg/TFMessage")(transforms=[transform]))

    def markers(self, stamp: int, positions_m: FloatArray) -> None:
        """Write the markers (15, 3), if they are known."""
        if not np.isfinite(positions_m).all():
            return
        self._put("/marker_poses", stamp, marker_poses_message(positions_m, stamp))

    def joints(self, stamp: int, part: StoredResult, row: int) -> None:
        """Write the joints and their standard deviations, as far as they are known.

        They are the result's angles, or the body's parameters if it has none.
        """
        at, names = self._body.joints, list(self._body.joint_names)
        both = part.parameters[row, at], part.parameters_sd[row, at]
        if self._angles:
            names, at = self._angles, np.array(self._columns)
            both = np.deg2rad(part.angles_deg[row, at]), np.deg2rad(part.angles_sd_deg[row, at])
        for topic, values in zip(("/joint_states", "/joint_deviations"), both, strict=True):
            if np.isfinite(values).all():
                self._put(topic, stamp, self._joints(stamp, names, values))

    def _joints(self, stamp: int, names: list[str], values: FloatArray) -> Any:
        return message_type("sensor_msgs/msg/JointState")(
            header=header(stamp, ""),
            name=names,
            position=np.ascontiguousarray(values, dtype=np.float64),
            velocity=np.empty(0),
            effort=np.empty(0),
        )

    def _put(self, topic: str, stamp_ns: int, message: Any) -> None:
        self._writer.write(self._topics[topic], stamp_ns, message)
