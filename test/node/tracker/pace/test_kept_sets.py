"""Which sets the worker takes while the tracker searches for a person; stamps in steps of 80 ms."""

import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest

from markerless_tracker.node.tracker.handle import TrackedSet, TrackerHandle
from markerless_tracker.node.tracker.pace.waiting import FOLLOWED_SPACING_NS
from markerless_tracker.node.tracker.status import TrackerStatus
from markerless_tracker.node.tracker.synchronizer import Synchronizer
from markerless_tracker.node.tracker.worker import TrackWorker
from markerless_tracker.records import TrackResult, TrackState

STAMPS = [number * FOLLOWED_SPACING_NS for number in range(1, 7)]


class SearchingTracker:
    """A tracker whose steps wait until they may end."""

    def __init__(self) -> None:
        self.state, self.settling = TrackState.TRACKING, False
        self.free = threading.Event()
        self.body: Any = object()
        self.rig: Any = object()

    def warm_up(self) -> None:
        pass

    def prepare(self, views: Any, stamp_ns: int) -> Any:
        return views

    def step(self, views: Any, stamp_ns: int, effort: float = 1.0) -> TrackResult:
        assert self.free.wait(60)
        pose = None if self.state is TrackState.SEARCHING else np.zeros(3)
        return TrackResult(
            stamp_ns, self.state, pose, None, 1.5, {"a": 0.5}, 7, settling=self.settling
        )

    def reset(self) -> None:
        pass

    def take_backgrounds(self, backgrounds: Any) -> None:
        pass


def until(condition: Callable[[], Any]) -> None:
    end = time.monotonic() + 120
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.002)


class Worker:
    """A worker that tracks what is offered."""

    def __init__(self, kept: int, *, searches: bool = True) -> None:
        self.tracker = SearchingTracker()
        self.sets: Synchronizer[int] = Synchronizer(("a",))
        self.published: list[int] = []
        self.status = status = TrackerStatus()
        handle = TrackerHandle(
            self.tracker, None, lambda name, view: np.zeros(1), kept=kept, searches=searches
        )
        self.worker = TrackWorker(
            self.sets,
            status,
            prepare=lambda: handle,
            publish=self.publish,
            report=lambda line: None,
        )
        self.worker.start()
        until(lambda: status.ready)

    def publish(self, tracked: TrackedSet) -> None:
        self.published.append(tracked.result.stamp_ns)

    def take_during_a_step(self, *stamps: int) -> None:
        """Offer sets while the first is tracked; the second is taken ahead."""
        for number, stamp in enumerate(stamps):
            self.sets.add("a", stamp, 7, now_s=time.monotonic())
            if number < 2:
                until(lambda: self.sets.held == 0)
        self.tracker.free.set()

    def count(self, key: str) -> int:
        """A count of `state`."""
        return int(self.status.values(self.sets.counts, (), ())[key])


@pytest.fixture
def make_worker() -> Iterator[Callable[..., Worker]]:
    made = []

    def make(kept: int, *, searches: bool = True) -> Worker:
        made.append(Worker(kept, searches=searches))
        return made[-1]

    yield make
    for worker in made:
        worker.tracker.free.set()
        assert worker.worker.stop(60)


def test_sets_that_come_during_the_start_are_kept(make_worker: Callable[..., Worker]) -> None:
    worker = make_worker(10)
    worker.tracker.settling = True
    worker.take_during_a_step(*STAMPS)
    until(lambda: len(worker.published) == len(STAMPS))
    assert worker.published == STAMPS and worker.sets.counts.skipped == 0


def test_sets_that_wait_at_the_end_are_counted(make_worker: Callable[..., Worker]) -> None:
    worker = make_worker(10)
    worker.tracker.settling = True
    for number, stamp in enumerate(STAMPS):
        worker.sets.add("a", stamp, 7, now_s=time.monotonic())
        if number < 2:
            until(lambda: worker.sets.held == 0)
    with ThreadPoolExecutor(1) as pool:
        ended = pool.submit(worker.worker.stop, 60)
        until(worker.worker._stop.is_set)
        worker.tracker.free.set()
        assert ended.result()
    assert worker.published == STAMPS[:1]
    assert (worker.count("tracked"), worker.count("dropped_at_end")) == (1, len(STAMPS) - 1)


def test_no_more_are_kept_than_the_memory_holds(make_worker: Callable[..., Worker]) -> None:
    worker = make_worker(2)
    worker.tracker.settling = True
    worker.take_during_a_step(*STAMPS)
    until(lambda: len(worker.published) == 4)
    assert worker.published == [*STAMPS[:2], *STAMPS[-2:]] and worker.sets.counts.skipped == 2


def test_sets_that_came_while_nobody_was_found_are_skipped(
    make_worker: Callable[..., Worker],
) -> None:
    worker = make_worker(10)
    worker.tracker.state = TrackState.SEARCHING
    worker.take_during_a_step(*STAMPS)
    until(lambda: len(worker.published) == 3)
    assert worker.published == [*STAMPS[:2], STAMPS[-1]] and worker.sets.counts.skipped == 3


def test_sets_that_come_while_a_lost_person_is_searched_for_are_kept(
    make_worker: Callable[..., Worker],
) -> None:
    worker = make_worker(10)
    worker.tracker.state = TrackState.LOST
    worker.take_during_a_step(*STAMPS[:1])
    until(lambda: len(worker.published) == 1)
    # This step gives the person up, searches, and finds the person.
    worker.tracker.free.clear()
    worker.tracker.state, worker.tracker.settling = TrackState.TRACKING, True
    worker.take_during_a_step(*STAMPS[1:])
    until(lambda: len(worker.published) == len(STAMPS))
    assert worker.published == STAMPS and worker.sets.counts.skipped == 0


def test_a_tracked_person_is_tracked_in_the_newest_set(
    make_worker: Callable[..., Worker],
) -> None:
    worker = make_worker(10)
    worker.take_during_a_step(*STAMPS[:1])
    until(lambda: len(worker.published) == 1)
    worker.tracker.free.clear()
    worker.take_during_a_step(*STAMPS[1:])
    until(lambda: len(worker.published) == 4)
    assert worker.published == [*STAMPS[:3], STAMPS[-1]]


def test_from_a_start_pose_the_newest_set_is_tracked(make_worker: Callable[..., Worker]) -> None:
    worker = make_worker(10, searches=False)
    worker.take_during_a_step(*STAMPS)
    until(lambda: len(worker.published) == 3)
    assert worker.published == [*STAMPS[:2], STAMPS[-1]]
