"""The body's description while the body is being revised."""

from dataclasses import replace

import pytest

# ruff: noqa: E402
rclpy = pytest.importorskip("rclpy", reason="ROS 2 is not installed")

from std_msgs.msg import String

from markerless_tracker.body import load_body
from markerless_tracker.node.ros.qos import latched_qos
from markerless_tracker.node.tracker.parameters import NodeSettings
from markerless_tracker.node.tracker.publishing.results import (
    DESCRIBED_EVERY_NS,
    ResultPublishers,
)
from markerless_tracker.records import TrackResult, TrackState
from markerless_tracker.tracking import TrackerConfig


def at(stamp_ns: int) -> TrackResult:
    return TrackResult(
        stamp_ns=stamp_ns, state=TrackState.LOST, pose=None, markers_m=None, fitness=0.0,
        evaluations=0, observations={}, iou={},
    )  # fmt: skip


def test_a_revised_body_is_described_once_a_second(ros_context, tools) -> None:
    peer = tools.Peer(ros_context)
    results = ResultPublishers(
        peer.node, NodeSettings(tf="none", config=TrackerConfig()), None, print
    )
    seen = peer.collect(String, "robot_description", latched_qos())
    body = load_body("person32", 1.7)
    try:
        results.describe(body)
        peer.until(lambda: len(seen) == 1, "the first description")
        for frame in range(5):
            longer = replace(body, cone_length=body.cone_length * (1.01 + 0.01 * frame))
            results.publish(at(frame * DESCRIBED_EVERY_NS // 2), longer)
        peer.until(lambda: len(seen) == 4, "the descriptions of frames 0, 2 and 4")
    finally:
        peer.close()
    assert len({message.data for message in seen}) == 4
