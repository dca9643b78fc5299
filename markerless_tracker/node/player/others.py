"""Topics of a bag other than images and camera infos; stored messages are played unchanged."""

from collections.abc import Callable, Iterator, Sequence
from typing import Any

from rclpy.qos import QoSProfile

from markerless_tracker.datasets.bag.recording import BagRecording
from markerless_tracker.datasets.bag.stream import RawMessage
from markerless_tracker.errors import ConfigError, DatasetError
from markerless_tracker.node.ros.messages import message_class
from markerless_tracker.node.ros.qos import image_qos, latched_qos, output_qos

END_NS = 2**63 - 1
"""A time after all messages."""
LATCHED = ("tf_static", "robot_description")
"""Last parts of the names of latched topics, whose last message late subscribers receive, in bags
that do not say which topics are."""
_TRANSFORMS = 100
"""Messages of `tf_static` that late subscribers receive: each has one publisher's transforms."""


class OtherTopics:
    """Publishes topics of a bag, in the recorded order among the sets of images.

    Args:
        node: creates the publishers.
        recording: the bag.
        names: of the topics.

    Raises:
        ConfigError: the bag has no such topic.
        DatasetError: the type of a topic is not installed.
    """

    def __init__(self, node: Any, recording: BagRecording, names: Sequence[str]) -> None:
        self._recording = recording
        self._publishers: dict[str, Any] = {}
        types = recording.types
        for name in names:
            if name not in types:
                raise ConfigError(
                    f"topics: {name} is not in the bag, expected some of {', '.join(sorted(types))}"
                )
            self._publishers[name] = node.create_publisher(
                _type(name, types[name]), name, self._qos(name)
            )

    def up_to(self, *, later: bool) -> Callable[[int, int], list[RawMessage]]:
        """A function that gives the messages up to a set of images, each once, in order.

        Its arguments are the times in ns at which the set's first and last image were recorded;
        `END_NS` twice gives the messages after the last set.

        Args:
            later: whether the first set is not the bag's first: of the messages before it, only
                latched ones are given then.
        """
        if not self._publishers:
            return lambda first_ns, last_ns: []
        stored: Iterator[RawMessage] = self._recording.messages(tuple(self._publishers))
        following: list[RawMessage] = []
        left_out = later

        def take(first_ns: int, last_ns: int) -> list[RawMessage]:
            nonlocal left_out
            due = following[:]
            following.clear()
            if due and due[0].log_ns > last_ns:
                following.extend(due)
                return []
            for message in stored:
                if message.log_ns > last_ns:
                    following.append(message)
                    break
                due.append(message)
            if left_out:
                due = [m for m in due if m.log_ns >= first_ns or self._is_latched(m.topic)]
                left_out = False
            return due

        return take

    def _is_latched(self, topic: str) -> bool:
        return topic in self._recording.latched or topic.rsplit("/", 1)[-1] in LATCHED

    def _qos(self, topic: str) -> QoSProfile:
        if topic.endswith("tf_static"):
            return image_qos(latched=True, depth=_TRANSFORMS)
        return latched_qos() if self._is_latched(topic) else output_qos()

    def publish(self, messages: Sequence[RawMessage]) -> None:
        """Publish stored messages unchanged."""
        for message in messages:
            self._publishers[message.topic].publish(bytes(message.data))


def _type(topic: str, kind: str) -> Any:
    """The Python class of a message type such as geometry_msgs/msg/PoseArray."""
    try:
        return message_class(kind)
    except (ImportError, AttributeError) as error:
        raise DatasetError(
            f"topics: {topic} has the type {kind}, whose package is not installed here"
        ) from error
