"""Subscriptions that follow their publishers, over the real middleware."""

from typing import Any

import pytest

pytest.importorskip("rclpy", reason="ROS 2 is not installed")

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import String

from markerless_tracker.node.ros.qos import FollowingSubscription, latched_qos


def test_a_subscription_follows_its_publishers_and_back(peer: Any) -> None:
    got: list[str] = []
    subscription = FollowingSubscription(
        peer.node, String, "words", lambda message: got.append(message.data)
    )
    effort = QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)
    for qos, durability in (
        (QoSProfile(depth=5), DurabilityPolicy.VOLATILE),
        (effort, DurabilityPolicy.VOLATILE),
        (latched_qos(), DurabilityPolicy.TRANSIENT_LOCAL),
        (QoSProfile(depth=5), DurabilityPolicy.VOLATILE),
    ):
        publisher = peer.node.create_publisher(String, "words", qos)
        if durability == DurabilityPolicy.TRANSIENT_LOCAL:
            publisher.publish(String(data="before"))
        peer.until(lambda: peer.node.count_publishers("words") == 1, "one publisher")

        def followed(qos: Any = qos, durability: Any = durability) -> bool:
            subscription.follow()
            (found,) = peer.node.get_subscriptions_info_by_topic("words") or [None]
            offered = None if found is None else found.qos_profile
            return (
                offered is not None
                and offered.reliability == qos.reliability
                and offered.durability == durability
            )

        peer.until(followed, f"a subscription like {qos}")
        if durability == DurabilityPolicy.TRANSIENT_LOCAL:
            peer.until(lambda: got == ["before"], "what was sent before")
        peer.until(lambda p=publisher: p.get_subscription_count() == 1, "the match")
        got.clear()
        publisher.publish(String(data="now"))
        peer.until(lambda: got == ["now"], "a message")
        got.clear()
        peer.node.destroy_publisher(publisher)
        peer.until(lambda: peer.node.count_publishers("words") == 0, "no publisher")
