"""Settings changed by the parameters of a node, and what a result records of them."""

from collections.abc import Iterator
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="ROS 2 is not installed")

from rclpy.node import Node
from rclpy.parameter import Parameter

from markerless_tracker.imaging import learn_background
from markerless_tracker.node.tracker.changes import LiveSettings
from markerless_tracker.tracking import TrackerConfig, build_tracker

FRAME_NS = 33_333_333
NAMES = ("optimizer", "evaluations", "smoothing")


@pytest.fixture
def node(ros_context: Any) -> Iterator[Node]:
    node = Node("settings", context=ros_context)
    values = TrackerConfig(body="balan31").by_name()
    node.declare_parameters("", [(name, values[name]) for name in NAMES])
    yield node
    node.destroy_node()


def test_what_follows_from_a_change_is_recorded_with_it(world: Any, node: Node) -> None:
    config = TrackerConfig(body="balan31")
    told: list[str] = []
    live = LiveSettings(node, {"body": "balan31"}, config, told.append)
    backgrounds = {
        name: learn_background(images) for name, images in world.scene.backgrounds(4).items()
    }
    # Nobody is seen, so that a step takes no time.
    images = {name: background[0] for name, background in world.scene.backgrounds(1).items()}
    tracker = live.settable(build_tracker(world.scene.rig, config, backgrounds=backgrounds).tracker)

    def put(name: str, value: Any) -> bool:
        (done,) = node.set_parameters([Parameter(name, value=value)])
        return bool(done.successful)

    changes = [("optimizer", "pso"), ("optimizer", "sppso"), ("smoothing", "one_euro")]
    for number, change in enumerate(changes):
        assert put(*change)
        assert len(live.record) == number, "a change holds from the next step on"
        tracker.step(images, number * FRAME_NS)
    assert live.record == [
        {"stamp_ns": 0, "optimizer": "pso", "evaluations": 3600},
        {"stamp_ns": FRAME_NS, "optimizer": "sppso", "evaluations": 1000},
        {"stamp_ns": 2 * FRAME_NS, "smoothing": "one_euro"},
    ]
    assert told[0] == "from the next set on: optimizer is pso, evaluations is 3600"
    assert not put("optimizer", "magic") and len(live.record) == 3
