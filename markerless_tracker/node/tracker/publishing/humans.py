"""Publishes the person on the topics of REP-155 (ROS4HRI)."""

from typing import Any

from sensor_msgs.msg import JointState
from std_msgs.msg import String

from markerless_tracker.body import BodyModel
from markerless_tracker.geometry import FloatArray
from markerless_tracker.node.ros.messages import header
from markerless_tracker.node.ros.qos import latched_qos, output_qos
from markerless_tracker.node.ros.ros4hri import Human


class HumanPublisher:
    """Publishes the joints and the URDF of a person below ``/humans/bodies/<id>``.

    Args:
        node: creates the publishers.
        name: the person's id; empty: nothing is published.
    """

    def __init__(self, node: Any, name: str) -> None:
        self._name = name
        self._human: Human | None = None
        if name:
            topic = f"/humans/bodies/{name}"
            self._states = node.create_publisher(JointState, f"{topic}/joint_states", output_qos())
            self._urdfs = node.create_publisher(String, f"{topic}/urdf", latched_qos())

    def describe(self, body: BodyModel) -> None:
        """Take a body and publish its URDF."""
        if self._name:
            if self._human is None:
                self._human = Human(body, self._name)
            self._human.take(body)
            self._urdfs.publish(String(data=self._human.urdf()))

    def publish(self, pose: FloatArray, stamp_ns: int) -> None:
        """Publish the joints of a pose (p,) at the time of its images, if there are subscribers."""
        if self._human is not None and self._states.get_subscription_count():
            values = self._human.joints(pose)
            self._states.publish(
                JointState(
                    header=header(stamp_ns, ""), name=list(values), position=list(values.values())
                )
            )
