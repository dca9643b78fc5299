"""Quality-of-service profiles by purpose."""

from collections.abc import Callable
from typing import Any

from rclpy.callback_groups import CallbackGroup
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

IMAGE_DEPTH = 5
"""Queue depth for images; with the shipped Fast DDS profile none is lost at 60 Hz."""


def image_qos(*, reliable: bool = True, depth: int = IMAGE_DEPTH) -> QoSProfile:
    """For images and camera infos. A reliable subscription does not match best-effort cameras."""
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.VOLATILE,
    )


def latched_qos() -> QoSProfile:
    """Transient local: late subscribers receive the last message."""
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=1,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL,
    )


def output_qos() -> QoSProfile:
    """For results."""
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST, depth=10, reliability=ReliabilityPolicy.RELIABLE
    )


class FollowingSubscription:
    """A subscription that becomes best effort if a publisher offers no more.

    A reliable subscription does not match a best-effort publisher.

    Args:
        node: creates the subscription.
        kind: message type.
        topic: its name.
        callback: as for ``rclpy.node.Node.create_subscription``.
        depth: messages the middleware keeps.
        raw: whether the callback gets the serialised bytes.
        polled: whether messages are taken by `poll` alone; the executor then spends no time on
            them.
    """

    def __init__(
        self,
        node: Any,
        kind: Any,
        topic: str,
        callback: Callable[..., None],
        *,
        depth: int = IMAGE_DEPTH,
        raw: bool = False,
        polled: bool = False,
    ) -> None:
        self._node, self._kind, self._topic, self._callback = node, kind, topic, callback
        self._depth, self._raw = depth, raw
        self._group = _NotExecuted() if polled else None
        self._reliable = True
        self._subscription = self._subscribe()

    def follow(self) -> None:
        """Adapt to the publishers' reliability; to be called periodically."""
        if not self._reliable:
            return
        offers = self._node.get_publishers_info_by_topic(self._topic)
        if any(o.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT for o in offers):
            self._node.get_logger().info(f"{self._topic} is best effort, subscribed likewise")
            self._reliable = False
            self._node.destroy_subscription(self._subscription)
            self._subscription = self._subscribe()

    def poll(self) -> None:
        """Call back with the newest message that waits, if any; from the executor's thread."""
        newest = None
        handle = self._subscription.handle
        with handle:
            while (taken := handle.take_message(self._kind, self._raw)) is not None:
                newest = taken
        if newest is not None:
            self._callback(newest[0])

    def _subscribe(self) -> Any:
        qos = image_qos(reliable=self._reliable, depth=self._depth)
        return self._node.create_subscription(
            self._kind,
            self._topic,
            self._callback,
            qos,
            raw=self._raw,
            callback_group=self._group,
        )


class _NotExecuted(CallbackGroup):
    """Its subscriptions are left out when an executor waits."""

    def can_execute(self, entity: Any) -> bool:
        return False

    def beginning_execution(self, entity: Any) -> bool:
        return False

    def ending_execution(self, entity: Any) -> None:
        pass
