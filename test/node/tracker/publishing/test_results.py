"""The body's description while the body is being revised; messages only for subscribers."""

from dataclasses import replace

import numpy as np
import pytest

# ruff: noqa: E402
rclpy = pytest.importorskip("rclpy", reason="ROS 2 is not installed")

from geometry_msgs.msg import PoseArray
from std_msgs.msg import String

from markerless_tracker.body import load_body, markers
from markerless_tracker.node.ros import messages
from markerless_tracker.node.ros.qos import latched_qos, output_qos
from markerless_tracker.node.tracker.parameters import NodeSettings
from markerless_tracker.node.tracker.publishing.results import (
    DESCRIBED_EVERY_NS,
    ResultPublishers,
)
from markerless_tracker.records import Confidence, TrackResult, TrackState
from markerless_tracker.tracking import TrackerConfig


def at(stamp_ns: int) -> TrackResult:
    return TrackResult(
        stamp_ns=stamp_ns, state=TrackState.LOST, pose=None, markers_m=None, fitness=0.0,
        evaluations=0, observations={}, iou={},
    )  # fmt: skip


def test_a_revised_body_is_described_once_a_second(ros_context, tools) -> None:
    peer = tools.Peer(ros_context)
    settings = NodeSettings(tf="none", config=TrackerConfig())
    results = ResultPublishers(peer.node, settings, None, print)
    seen = peer.collect(String, "robot_description", latched_qos())
    body = load_body("person32", 1.7)
    try:
        results.describe(body)
        peer.until(lambda: len(seen) == 1, "the first description")
        for frame in range(5):
            longer = replace(body, cone_length=body.cone_length * (1.01 + 0.01 * frame))
            results.publish(at(frame * DESCRIBED_EVERY_NS // 2), longer)
            if frame % 2 == 0:
                due = 2 + frame // 2
                peer.until(lambda due=due: len(seen) == due, f"description {due}")
    finally:
        peer.close()
    # Those of frames 1 and 3 would have replaced others, or come besides.
    assert len({message.data for message in seen}) == len(seen) == 4


def test_messages_are_made_for_subscribers_only(ros_context, tools, monkeypatch) -> None:
    peer = tools.Peer(ros_context)
    results = ResultPublishers(
        peer.node, NodeSettings(tf="none", config=TrackerConfig()), None, print
    )
    body = load_body("person32", 1.7)
    sure = Confidence(np.full(body.size, 0.1), np.full((15, 3), 0.1), np.eye(6))
    tracked = replace(
        at(0), state=TrackState.TRACKING, pose=body.neutral,
        markers_m=markers(body, body.neutral), confidence=sure,
    )  # fmt: skip
    made: list[str] = []
    for name in ("joint_state", "joint_deviations", "root_pose", "marker_poses", "body_markers"):
        plain = getattr(messages, name)
        monkeypatch.setattr(
            messages, name, lambda *args, name=name, plain=plain: made.append(name) or plain(*args)
        )
    try:
        results.publish(tracked, body)
        assert made == []
        poses = peer.collect(PoseArray, "marker_poses", output_qos())
        peer.until(lambda: bool(results.publish(tracked, body) or poses), "the marker poses")
    finally:
        peer.close()
    assert set(made) == {"marker_poses"}
