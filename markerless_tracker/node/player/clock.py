"""Publishes the time of a bag on `/clock`, for nodes with `use_sim_time`."""

import math
from typing import Any

from rosgraph_msgs.msg import Clock

from markerless_tracker.node.ros.qos import output_qos
from markerless_tracker.node.ros.stamps import time_message


class BagClock:
    """Publishes the time of a bag that is being played; nothing if `hz` is 0.

    Args:
        node: creates the publisher.
        hz: messages per s between two sets; each set has one in addition.
        rate: pace at which the bag is played; 1 is the recorded pace.
    """

    def __init__(self, node: Any, hz: float, rate: float) -> None:
        self._period_s = 1.0 / hz if hz else math.inf
        self._rate = rate
        self._last_ns = 0
        self._publisher = node.create_publisher(Clock, "/clock", output_qos()) if hz else None

    def tick(self, next_ns: int, left_s: float) -> float:
        """Publish the time before a set due in `left_s`; returns the seconds to the next call."""
        now_ns = next_ns - round(left_s * self._rate * 1e9)
        # The clock does not run backwards if the set before was early.
        if self._publisher is not None and now_ns > self._last_ns:
            self.publish(now_ns)
        return self._period_s

    def publish(self, stamp_ns: int) -> None:
        """Publish a time; it runs backwards when a bag restarts."""
        self._last_ns = stamp_ns
        if self._publisher is not None and stamp_ns >= 0:
            self._publisher.publish(Clock(clock=time_message(stamp_ns)))
