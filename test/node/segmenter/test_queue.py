"""Images that come faster than they are segmented are thinned out alike in all segmenters."""

import time
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="ROS 2 is not installed")

from markerless_tracker.errors import ImageError
from markerless_tracker.node.segmenter.worker import (
    CALM,
    QUEUE,
    ImageQueue,
    SegmenterStatus,
    SegmentWorker,
    Waiting,
)

PERIOD_NS = 16_666_667
FIRST_NS = 1_700_000_000_123_456_789


def add(queue: ImageQueue, number: int) -> bool:
    return queue.add("cam01", FIRST_NS + number * PERIOD_NS, number, now_s=float(number))


def rest(queue: ImageQueue) -> list[int]:
    found = []
    while (taken := queue.take(0.0)) is not None:
        found.append(taken.message)
    return found


def test_images_come_in_their_order_and_none_is_lost_in_time() -> None:
    queue = ImageQueue()
    for number in range(100):
        assert add(queue, number)
        if number % 3 == 2:
            assert rest(queue) == [number - 2, number - 1, number]
    assert queue.received == 100 and queue.dropped == 0 and queue.share == 1


def test_segmenters_of_unequal_speed_keep_sets_in_common() -> None:
    """One segments every third image in time, the other every fifth: 1 of 4 and 1 of 8 are kept."""
    kept = []
    for takes in (3, 5):
        queue, done = ImageQueue(), []
        for number in range(1200):
            add(queue, number)
            if number % takes == 0 and (taken := queue.take(0.0)) is not None:
                done.append(taken.message)
        assert queue.received == 1200 and queue.share > 1
        assert len(done) + queue.dropped + len(rest(queue)) == 1200
        kept.append(set(done))
    slow, fast = sorted(kept, key=len)
    settled = {number for number in slow if number > 300}
    assert len(settled) > 40
    assert len(settled & fast) > 0.6 * len(settled)


def test_memory_is_bounded_whatever_the_stamps() -> None:
    queue = ImageQueue()
    for number in range(500):
        queue.add("cam01", 5, number, now_s=0.0)
    assert len(rest(queue)) <= QUEUE


def test_more_are_kept_again_once_there_is_time() -> None:
    queue = ImageQueue()
    for number in range(4 * QUEUE):
        add(queue, number)
    assert queue.share > 1
    number = 4 * QUEUE
    while queue.share > 1:
        number += 1
        add(queue, number)
        rest(queue)
        assert number < 100 * CALM
    assert add(queue, number + 1) and add(queue, number + 2)


def test_images_without_evidence_are_counted_and_their_reason_is_kept() -> None:
    status, reports = SegmenterStatus(), []
    queue = ImageQueue()

    def observe(waiting: Waiting) -> Any:
        if waiting.stamp_ns < 2:
            raise ImageError("cam01: 8x8 px came")
        return waiting

    worker = SegmentWorker(
        queue, status, observe=observe, publish=lambda _: 7, report=reports.append
    )
    worker.start()
    try:
        for stamp_ns in range(2):
            queue.add("cam01", stamp_ns, SimpleNamespace(data=b"abc"), now_s=0.0)
        until(lambda: status.values()["failed"] == "2")
        assert status.trouble == reports[-1] == "stamp 1: cam01: 8x8 px came"
        queue.add("cam01", 2, SimpleNamespace(data=b"abc"), now_s=0.0)
        until(lambda: status.values()["published"] == "1")
        assert status.trouble == "" and status.values()["last_error"] == reports[-1]
    finally:
        assert worker.stop(60.0)


def until(holds: Callable[[], bool]) -> None:
    end_s = time.monotonic() + 60.0
    while not holds():
        assert time.monotonic() < end_s
        time.sleep(0.01)
