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
