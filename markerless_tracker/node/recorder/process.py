"""Runs a recorder in this process, until a signal or for a given time."""

import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING

from markerless_tracker.node.ros.process import NOTICE_S, StopSignals, require_ros, running
from markerless_tracker.node.ros.profile import apply_profile

if TYPE_CHECKING:
    from markerless_tracker.node.recorder.node import Bag


def record(
    writer: "Bag",
    stop: StopSignals,
    *,
    topics: Sequence[str] | None = None,
    seconds: float | None = None,
    progress: Callable[[int], None] | None = None,
) -> dict[str, int]:
    """Record topics into a bag.

    Args:
        writer: of the bag.
        stop: ends the recording.
        topics: names; None = all except those of ROS itself and images for debugging.
        seconds: duration; None = until a signal.
        progress: called with the number of messages.

    Returns:
        Topic -> number of messages.

    Raises:
        RosMissingError: ROS is not installed.
    """
    prepare()
    from markerless_tracker.node.recorder.node import RecorderNode

    with running(partial(RecorderNode, writer, topics)) as (node, executor):
        until_s = None if seconds is None else time.monotonic() + seconds
        while not stop.received and (until_s is None or time.monotonic() < until_s):
            executor.spin_once(timeout_sec=NOTICE_S)
            if progress is not None:
                progress(writer.messages)
    return dict(node.counts)


def prepare() -> None:
    """Choose the profile of the middleware and make sure that ROS is installed.

    Raises:
        RosMissingError: ROS is not installed.
    """
    apply_profile()
    require_ros()
