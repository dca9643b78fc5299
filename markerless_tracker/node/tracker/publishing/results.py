"""Publishes results as topics and frames; messages of a pose are made for subscribers only."""

from collections.abc import Callable
from typing import Any

from geometry_msgs.msg import PoseArray, PoseWithCovarianceStamped
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from visualization_msgs.msg import MarkerArray

from markerless_tracker.body import BodyModel, root_transform
from markerless_tracker.body.angles import AngleReader
from markerless_tracker.body.urdf import urdf
from markerless_tracker.camera import CameraRig
from markerless_tracker.node.ros import messages
from markerless_tracker.node.ros.qos import latched_qos, output_qos
from markerless_tracker.node.tracker.parameters import NodeSettings
from markerless_tracker.node.tracker.publishing.frames import FramePublisher
from markerless_tracker.node.tracker.publishing.humans import HumanPublisher
from markerless_tracker.records import TrackResult

DESCRIBED_EVERY_NS = 1_000_000_000
"""Shortest time between two descriptions of a body that is being revised."""


class ResultPublishers:
    """Publishes poses, and the body whenever it changes.

    Args:
        node: creates the publishers.
        settings: the node's.
        rig: cameras whose frames are published; None for none.
        inform: called with a line about what cannot be published.
    """

    def __init__(
        self,
        node: Any,
        settings: NodeSettings,
        rig: CameraRig | None,
        inform: Callable[[str], None],
    ) -> None:
        self._human = HumanPublisher(node, settings.human_id)
        self._frames = FramePublisher(
            node,
            settings.tf,
            cameras=settings.tf_cameras and rig is not None,
            prefix=settings.frame_prefix,
            human=settings.human_id,
            inform=inform,
        )
        if rig is not None:
            self._frames.cameras(rig)
        qos = output_qos()
        self._descriptions = node.create_publisher(String, "robot_description", latched_qos())
        self._joint_states = node.create_publisher(JointState, "joint_states", qos)
        self._deviations = node.create_publisher(JointState, "joint_deviations", qos)
        self._root_poses = node.create_publisher(PoseWithCovarianceStamped, "root_pose", qos)
        self._marker_poses = node.create_publisher(PoseArray, "marker_poses", qos)
        self._markers = node.create_publisher(MarkerArray, "markers", qos)
        self._described: BodyModel | None = None
        self._described_ns: int | None = None
        self._reported: BodyModel | None = None
        self._angles: AngleReader | None = None
        self._no_pose_shown = False

    def describe(self, body: BodyModel) -> None:
        """Publish the body's URDF if the body has changed."""
        if body is not self._described:
            description = urdf(body)
            self._descriptions.publish(String(data=description))
            self._frames.describe(description, body.root_frame)
            self._human.describe(body)
            self._described = body
            self._take(body)

    def _take(self, body: BodyModel) -> None:
        """Report the angles of this body from now on."""
        if self._angles is None:
            self._angles = AngleReader(body)
        if body is not self._reported:
            self._angles.take(body)
            self._reported = body

    def _follow(self, body: BodyModel, stamp_ns: int) -> None:
        """As `describe`, at most once per `DESCRIBED_EVERY_NS`: a revised body hardly differs."""
        self._take(body)
        last_ns = self._described_ns
        if last_ns is None or abs(stamp_ns - last_ns) >= DESCRIBED_EVERY_NS:
            self._described_ns = stamp_ns
            self.describe(body)

    def publish(self, result: TrackResult, body: BodyModel) -> None:
        """Publish a result, if there are subscribers; without a pose, delete the body, once."""
        self._follow(body, result.stamp_ns)
        pose, points, stamp_ns = result.pose, result.markers_m, result.stamp_ns
        if pose is None or points is None:
            if not self._no_pose_shown:
                self._markers.publish(messages.no_markers(stamp_ns))
            self._no_pose_shown = True
            return
        confidence = result.confidence
        covariance = None
        if confidence is not None and self._deviations.get_subscription_count():
            covariance = confidence.covariance
        assert self._angles is not None
        # Angles continue those of the last frame, so they are read without subscribers, too.
        angles = self._angles.read(pose, stamp_ns, covariance)
        if self._joint_states.get_subscription_count():
            self._joint_states.publish(messages.joint_state(angles, stamp_ns))
        values = dict(zip(angles.names, angles.values_rad.tolist(), strict=True))
        self._frames.publish(root_transform(body, pose), values, stamp_ns)
        self._human.publish(pose, stamp_ns)
        if self._root_poses.get_subscription_count():
            self._root_poses.publish(messages.root_pose(body, pose, stamp_ns, confidence))
        if covariance is not None:
            self._deviations.publish(messages.joint_deviations(angles, stamp_ns))
        if self._marker_poses.get_subscription_count():
            self._marker_poses.publish(messages.marker_poses(points, stamp_ns))
        if self._markers.get_subscription_count():
            self._markers.publish(messages.body_markers(body, pose, points, stamp_ns))
        self._no_pose_shown = False
