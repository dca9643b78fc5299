"""Parameters of a real node: groups, ranges and choices."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from markerless_tracker.tracking import TrackerConfig

PARAMETERS = """
tracker:
  ros__parameters:
    seed: 5
    refine: {truncation_m: 0.08}
    shadow.value_min: 0.25
"""


@pytest.fixture
def node(tmp_path: Path) -> Iterator[Any]:
    """A node that was given a file with groups, and one parameter on the command line."""
    rclpy = pytest.importorskip("rclpy", reason="ROS 2 is not installed")
    from rclpy.node import Node

    path = tmp_path / "tracker.yaml"
    path.write_text(PARAMETERS, encoding="utf-8")
    context = rclpy.Context()
    words = ["--ros-args", "--params-file", str(path), "-p", "apf.layers:=4"]
    # As a launch file gives them; an empty one is none.
    words += ["-p", "launch.seed:=7", "-p", "launch.refine.truncation_m:=''"]
    rclpy.init(context=context, args=words)
    node = Node("tracker", context=context, automatically_declare_parameters_from_overrides=True)
    yield node
    node.destroy_node()
    context.try_shutdown()


def test_settings_in_groups_are_parameters_with_ranges_and_choices(node: Any) -> None:
    from markerless_tracker.node.ros.declared import FIXED, declare_effective, given_parameters
    from markerless_tracker.node.tracker.parameters import (
        descriptions,
        effective_values,
        read_settings,
    )

    given = given_parameters(node)
    expected = {
        "seed": 7, "refine.truncation_m": 0.08, "shadow.value_min": 0.25, "apf.layers": 4
    }  # fmt: skip
    assert given == expected
    settings = read_settings(given)
    assert settings.config == TrackerConfig.from_mapping(expected)
    declare_effective(node, effective_values(settings), descriptions(), TrackerConfig.settings())

    assert {name: node.get_parameter(name).value for name in expected} == expected
    assert not node.has_parameter("launch.seed")
    (layers,) = node.describe_parameter("apf.layers").integer_range
    assert (layers.from_value, layers.to_value, layers.step) == (0, 100, 1)
    (seed,) = node.describe_parameter("seed").integer_range
    assert (seed.from_value, seed.to_value) == (0, 2**63 - 1)
    (truncation,) = node.describe_parameter("refine.truncation_m").floating_point_range
    assert (truncation.from_value, truncation.to_value) == (0.001, 10.0)
    form = node.describe_parameter("edges.form")
    assert form.additional_constraints == "one of soft, published; fixed while the node runs"
    assert form.read_only and "gradient" in form.description
    for entry in TrackerConfig.settings():
        descriptor = node.describe_parameter(entry.name)
        ranges = (len(descriptor.integer_range), len(descriptor.floating_point_range))
        assert ranges == (entry.type is int, entry.type is float), entry.name
        constraints = descriptor.additional_constraints
        assert ("one of " in constraints) == bool(entry.choices), entry.name
        assert constraints.endswith(FIXED), entry.name


def test_nothing_but_messages_wakes_the_executor(tmp_path: Path) -> None:
    rclpy = pytest.importorskip("rclpy", reason="ROS 2 is not installed")
    from std_msgs.msg import String

    from markerless_tracker.node.ros.declared import GivenNode

    context = rclpy.Context()
    rclpy.init(context=context, args=[])
    node = GivenNode("quiet", context=context)
    try:
        node.create_publisher(String, "out", 1)
        node.create_subscription(String, "in", lambda _: None, 1)
        assert len(list(node.publishers)) >= 2
        assert all(not publisher.event_handlers for publisher in node.publishers)
        assert all(not subscription.event_handlers for subscription in node.subscriptions)
    finally:
        node.destroy_node()
        context.try_shutdown()
