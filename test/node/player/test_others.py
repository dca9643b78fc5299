"""Messages of other topics among the sets of images, by the time at which both were recorded."""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="ROS 2 is not installed")

from rclpy.serialization import serialize_message
from std_msgs.msg import String

from markerless_tracker.datasets.bag.stream import Place, RawMessage
from markerless_tracker.node.player.others import END_NS, OtherTopics
from markerless_tracker.node.ros.qos import image_qos

LOGGED_NS = 1_700_000_000_000_000_000
PERIOD_NS = 20_000_000


def message(topic: str, log_ns: int) -> RawMessage:
    return RawMessage(topic, "geometry_msgs/msg/PoseArray", b"", Place(0, 0), log_ns)


@pytest.fixture
def up_to() -> Callable[..., Callable[[int, int], list[RawMessage]]]:
    """`up_to(stored, later=)`: that of `OtherTopics`."""

    def make(stored: list[RawMessage], *, later: bool = False):
        types = {each.topic: each.type for each in stored}
        recording = SimpleNamespace(
            types=types, latched={"/map"}, messages=lambda topics: iter(stored)
        )
        node = SimpleNamespace(create_publisher=lambda *_: None)
        return OtherTopics(node, recording, list(types)).up_to(later=later)

    return make


def test_each_set_has_the_messages_recorded_until_then(up_to) -> None:
    """Whatever the stamps are: the recorder's clock decides."""
    stored = [message("/marker_poses", LOGGED_NS + i * PERIOD_NS) for i in range(5)]
    take = up_to(stored)
    # The images of a set are recorded one after the other.
    taken = [
        take(LOGGED_NS + i * PERIOD_NS - 2_000_000, LOGGED_NS + i * PERIOD_NS) for i in range(5)
    ]
    assert taken == [[each] for each in stored]


def test_what_was_recorded_after_the_last_set_comes_at_the_end(up_to) -> None:
    """A tracker's results are recorded later than their images."""
    stored = [message("/marker_poses", LOGGED_NS + i * PERIOD_NS) for i in range(5)]
    take = up_to(stored)
    assert take(LOGGED_NS, LOGGED_NS + PERIOD_NS) == stored[:2]
    assert take(END_NS, END_NS) == stored[2:]
    assert take(END_NS, END_NS) == []


@pytest.mark.parametrize("name, kept", [("/tf_static", 4), ("/state", 1), ("/words", 0)])
def test_late_subscribers_receive_what_was_latched(peer: Any, name: str, kept: int) -> None:
    """Of transforms all, since each message has those of one publisher."""
    recording = SimpleNamespace(types={name: "std_msgs/msg/String"}, latched={"/state"})
    topics = OtherTopics(peer.node, recording, [name])
    content = [serialize_message(String(data=str(number))) for number in range(4)]
    topics.publish([RawMessage(name, "std_msgs/msg/String", c, Place(0, 0), 0) for c in content])
    heard = peer.collect(String, name, image_qos(latched=kept > 0, depth=100))
    peer.until(lambda: topics._publishers[name].get_subscription_count() == 1, "the match")
    peer.until(lambda: len(heard) >= kept, "what was sent before")
    assert [message.data for message in heard] == ["0", "1", "2", "3"][4 - kept :]


def test_a_later_first_set_comes_without_what_was_before(up_to) -> None:
    latched = message("/robot_description", LOGGED_NS - 1), message("/map", LOGGED_NS - 1)
    stored = [*latched, *(message("/marker_poses", LOGGED_NS + i * PERIOD_NS) for i in range(5))]
    take = up_to(stored, later=True)
    third = LOGGED_NS + 2 * PERIOD_NS
    assert take(third, third + 1_000_000) == [*latched, stored[4]]
    assert take(third + PERIOD_NS, third + PERIOD_NS) == [stored[5]]
    assert take(third + PERIOD_NS, third + PERIOD_NS) == []
