"""Quality-of-service profiles by purpose."""

from collections.abc import Callable
from typing import Any

from rclpy.callback_groups import CallbackGroup
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

IMAGE_DEPTH = 5
"""Queue depth for images; with the shipped Fast DDS profile none is lost at 60 Hz."""


TRANSPORTS = ("auto", "raw", "compressed")
"""Images to receive: whichever are offered, sensor_msgs/Image, or sensor_msgs/CompressedImage."""
EVIDENCE = "evidence"
"""A further transport of the tracker: evidence of segmenters instead of images."""


def image_qos(
    *, reliable: bool = True, latched: bool = False, depth: int = IMAGE_DEPTH
) -> QoSProfile:
    """For images and camera infos.

    A reliable subscription does not match best-effort publishers; a latched subscription matches
    latched publishers only.
    """
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
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
    """A subscription with the quality of service that its publishers offer.

    It is best effort if any publisher is, which a reliable subscription would not match. It is
    latched if all publishers are, and then receives their earlier messages.

    Args:
        node: creates the subscription.
        kind: message type.
        topic: its name.
        callback: as for ``rclpy.node.Node.create_subscription``.
        depth: messages the middleware keeps.
        raw: whether the callback gets the serialised bytes.
        polled: whether only `poll` takes messages, so that the executor spends no time on them.
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
        self._offered = (True, False)
        self._subscription = self._subscribe()

    def follow(self) -> None:
        """Adapt to the publishers; to be called periodically."""
        offered = self._offers()
        if offered is None or offered == self._offered:
            return
        reliable, latched = offered
        words = f"{'reliable' if reliable else 'best effort'}{' and latched' if latched else ''}"
        self._node.get_logger().info(f"{self._topic} is {words}, subscribed likewise")
        self._offered = offered
        self.close()
        self._subscription = self._subscribe()

    def _offers(self) -> tuple[bool, bool] | None:
        """Whether all publishers are reliable, and all latched; None without publishers."""
        offers = [o.qos_profile for o in self._node.get_publishers_info_by_topic(self._topic)]
        if not offers:
            return None
        return (
            all(o.reliability != ReliabilityPolicy.BEST_EFFORT for o in offers),
            all(o.durability == DurabilityPolicy.TRANSIENT_LOCAL for o in offers),
        )

    def close(self) -> None:
        """End the subscription."""
        self._node.destroy_subscription(self._subscription)

    def poll(self) -> None:
        """Call back with the newest queued message, if any; from the executor's thread."""
        newest = None
        handle = self._subscription.handle
        with handle:
            while (taken := handle.take_message(self._kind, self._raw)) is not None:
                newest = taken
        if newest is not None:
            self._callback(newest[0])

    def take_waiting(self) -> None:
        """Call back with all queued messages, each with its info; from the executor's thread."""
        handle = self._subscription.handle
        for _ in range(self._depth):
            with handle:
                taken = handle.take_message(self._kind, self._raw)
            if taken is None:
                return
            self._callback(*taken)

    def _subscribe(self) -> Any:
        reliable, latched = self._offered
        qos = image_qos(reliable=reliable, latched=latched, depth=self._depth)
        return self._node.create_subscription(
            self._kind,
            self._topic,
            self._callback,
            qos,
            raw=self._raw,
            callback_group=self._group,
        )


class _NotExecuted(CallbackGroup):
    """A callback group that executors ignore."""

    def can_execute(self, entity: Any) -> bool:
        return False

    def beginning_execution(self, entity: Any) -> bool:
        return False

    def ending_execution(self, entity: Any) -> None:
        pass
