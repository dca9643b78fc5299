"""The node `recorder`: writes the serialised messages of topics to a bag."""

import time
from collections.abc import Sequence
from typing import Any, Protocol

from rclpy.qos import DurabilityPolicy, QoSProfile

from markerless_tracker.node.ros.declared import GivenNode
from markerless_tracker.node.ros.messages import message_class
from markerless_tracker.node.ros.qos import FollowingSubscription

_SEARCH_S = 0.5
"""Interval of the search for new topics."""
_FLUSH_S = 0.5
"""Least time between two flushes. They come every `_SEARCH_S`: a kill loses at most the messages of
both times."""
_DEPTH = 50
_OF_ROS = ("/rosout", "/parameter_events")
_DEBUG = "/debug/"
"""Part of the names of images that the tracker draws only while somebody subscribes to them."""


class Bag(Protocol):
    """The part of a bag's writer (`bags.mcap_bag.BagWriter`) that the recorder uses."""

    def topic(self, name: str, kind: str, *, latched: bool = False) -> Any:
        """Declare a topic."""

    def write_serialized(self, topic: Any, stamp_ns: int, data: Any) -> None:
        """Write a message of a topic."""

    def flush(self) -> None:
        """Write buffered messages to the disk."""

    @property
    def messages(self) -> int:
        """Number of messages written."""


class RecorderNode(GivenNode):
    """Subscribes to topics as soon as they have a publisher, and writes their messages.

    The time of a message in the bag is its time of arrival.

    Args:
        writer: of the bag.
        topics: names of the topics; None = all but those of ROS itself and images for debugging.
        node_arguments: passed on to ``rclpy.node.Node`` (context, ...).
    """

    def __init__(self, writer: Bag, topics: Sequence[str] | None, **node_arguments: Any) -> None:
        super().__init__("recorder", **node_arguments)
        self._writer = writer
        self._wanted = None if topics is None else {f"/{name.strip('/')}" for name in topics}
        self._seen: set[str] = set()
        self._following: list[FollowingSubscription] = []
        self._flushed_s = time.monotonic()
        self.counts: dict[str, int] = {}
        self.create_timer(_SEARCH_S, self._search)
        self._search()

    def _search(self) -> None:
        """Subscribe to new topics; flush the bag at intervals."""
        if time.monotonic() - self._flushed_s > _FLUSH_S:
            self._writer.flush()
            self._flushed_s = time.monotonic()
        for name, kinds in self.get_topic_names_and_types():
            if name in self._seen or not self._is_wanted(name):
                continue
            offers = self.get_publishers_info_by_topic(name)
            if offers:
                self._record(name, kinds[0], [offer.qos_profile for offer in offers])
        # A publisher may come later, or be started again, with another quality of service.
        for subscription in self._following:
            subscription.follow()

    def _is_wanted(self, name: str) -> bool:
        if self._wanted is not None:
            return name in self._wanted
        return name not in _OF_ROS and _DEBUG not in name

    def _record(self, name: str, kind: str, offers: Sequence[QoSProfile]) -> None:
        self._seen.add(name)
        latched = all(o.durability == DurabilityPolicy.TRANSIENT_LOCAL for o in offers)
        try:
            message = message_class(kind)
            topic = self._writer.topic(name, kind, latched=latched)
        except Exception as error:  # an unknown type raises any exception of its library
            self.get_logger().warning(
                f"{name} is not recorded: its type {kind} is not known here "
                f"({type(error).__name__})"
            )
            return
        self.counts[name] = 0

        def write(data: bytes) -> None:
            self._writer.write_serialized(topic, time.time_ns(), data)
            self.counts[name] += 1

        self._following.append(
            FollowingSubscription(self, message, name, write, depth=_DEPTH, raw=True)
        )
        self.get_logger().info(f"recording {name}")
