import threading
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from markerless_tracker.errors import ConfigError, ImageError
from markerless_tracker.imaging import ImagingSettings
from markerless_tracker.node.tracker.handle import TrackedSet, TrackerHandle
from markerless_tracker.node.tracker.learning import Learning
from markerless_tracker.node.tracker.status import TrackerStatus
from markerless_tracker.node.tracker.synchronizer import Synchronizer
from markerless_tracker.node.tracker.worker import TrackWorker, one_line
from markerless_tracker.records import LimbState, TrackResult, TrackState

FRAME_NS = 16_666_667
KEYS = ("tracked", "dropped_before_start", "dropped_while_learning")


class FakeTracker:
    """A tracker that waits and raises as a test wants."""

    def __init__(self) -> None:
        self.seen: list[tuple[int, dict[str, Any]]] = []
        self.resets = 0
        self.threads: set[int] = set()
        self.compiled, self.free = threading.Event(), threading.Event()
        self.compiled.set()
        self.free.set()
        self.error: Exception | None = None
        self.state = TrackState.TRACKING
        self.backgrounds: dict[str, Any] = {}
        self.body: Any = object()
        self.rig: Any = object()

    def warm_up(self) -> None:
        self.threads.add(threading.get_ident())
        self.compiled.wait(60)
        if self.error:
            raise self.error

    def prepare(self, views: Any, stamp_ns: int) -> Any:
        return views

    def step(self, views: Any, stamp_ns: int, effort: float = 1.0) -> TrackResult:
        self.threads.add(threading.get_ident())
        self.free.wait(60)
        if self.error:
            raise self.error
        self.seen.append((stamp_ns, dict(views)))
        lost, fine = (LimbState(s, 0.5, 0.5) for s in (TrackState.LOST, TrackState.TRACKING))
        return TrackResult(
            stamp_ns, self.state, np.zeros(3), np.zeros((15, 3)), 1.5, {"a": 0.5}, 7,
            limbs={"l_arm": lost, "r_arm": fine, "l_leg": lost},
        )  # fmt: skip

    def reset(self) -> None:
        self.resets += 1

    def take_backgrounds(self, backgrounds: Any) -> None:
        if self.error:
            raise self.error
        self.backgrounds = dict(backgrounds)


class Bench:
    """A worker with a fake tracker, and everything it reports."""

    def __init__(self, start_ns: int | None = None) -> None:
        self.tracker = FakeTracker()
        self.sets: Synchronizer[int] = Synchronizer(("a", "b"))
        self.status = TrackerStatus()
        self.publishing_s, self.published = 0.0, list[TrackedSet]()
        self.reports: list[str] = []
        self.dealt: list[float] = []
        self.may_publish = threading.Event()
        self.may_publish.set()
        self.prepared: TrackerHandle | None = TrackerHandle(
            self.tracker, start_ns, lambda name, view: np.full((2, 2), view, np.uint8)
        )
        self.worker = TrackWorker(
            self.sets,
            self.status,
            prepare=lambda: self.prepared,
            publish=self.publish,
            report=self.reports.append,
            dealt=self.dealt.append,
        )

    def publish(self, tracked: TrackedSet) -> None:
        time.sleep(self.publishing_s)
        assert self.may_publish.wait(60)
        self.published.append(tracked)

    def offer(self, *stamps: int) -> None:
        for stamp in stamps:
            for camera in ("a", "b"):
                self.sets.add(camera, stamp, 7, now_s=time.monotonic())

    def values(self) -> dict[str, str]:
        return self.status.values(self.sets.counts, ("a", "b"), ())

    def until(self, condition: Callable[[], Any]) -> None:
        end = time.monotonic() + 120
        while not condition():
            assert time.monotonic() < end, self.values()
            time.sleep(0.002)


@pytest.fixture
def bench() -> Any:
    bench = Bench()
    yield bench
    bench.tracker.free.set()
    bench.tracker.compiled.set()
    assert bench.worker.stop(60)


def test_sets_are_decoded_and_tracked_in_one_thread_and_published(bench: Bench) -> None:
    bench.publishing_s = 0.05
    bench.worker.start()
    bench.until(lambda: bench.status.ready)
    bench.offer(5)
    bench.until(lambda: bench.published)
    stamp, views = bench.tracker.seen[0]
    assert stamp == 5 and views["a"].tolist() == [[7, 7], [7, 7]]
    assert bench.published[0].images["b"].shape == (2, 2)
    assert len(bench.tracker.threads) == 1
    assert threading.get_ident() not in bench.tracker.threads
    bench.until(lambda: bench.values()["latency_median_ms"] != "nan")
    values = bench.values()
    assert values["state"] == "TRACKING" and values["tracked"] == "1"
    assert values["iou/a"] == "0.5000" and values["iou/b"] == "nan"
    assert values["lost_limbs"] == "l_arm, l_leg"
    assert float(values["latency_median_ms"]) >= 50.0


def test_images_before_it_is_ready_are_dropped_and_counted_apart(bench: Bench) -> None:
    bench.tracker.compiled.clear()
    bench.worker.start()
    bench.until(lambda: bench.values()["activity"] == "compiling")
    bench.offer(1, 2, 3)
    assert bench.values()["ready"] == "false" and bench.values()["dropped_before_ready"] == "3"
    bench.tracker.compiled.set()
    bench.until(lambda: bench.status.ready)
    bench.offer(4)
    bench.until(lambda: bench.published)
    assert [stamp for stamp, _ in bench.tracker.seen] == [4]
    assert (bench.values()["dropped_before_ready"], bench.values()["skipped"]) == ("3", "0")


def test_a_slow_tracker_skips_to_the_newest(bench: Bench) -> None:
    bench.worker.start()
    bench.until(lambda: bench.status.ready)
    bench.tracker.free.clear()
    bench.offer(1)
    bench.until(lambda: bench.sets.held == 0)
    bench.offer(2, 3, 4)
    bench.tracker.free.set()
    bench.until(lambda: len(bench.published) == 2)
    assert [stamp for stamp, _ in bench.tracker.seen] == [1, 4]
    assert bench.values()["skipped"] == "2"


@pytest.mark.parametrize("error", [ImageError("cam01: too dark\nfor this"), ZeroDivisionError("x")])
def test_an_error_costs_its_set_and_is_reported(bench: Bench, error: Exception) -> None:
    bench.worker.start()
    bench.until(lambda: bench.status.ready)
    bench.tracker.error = error
    for count, stamp in enumerate((1, 2), 1):
        bench.offer(stamp)
        bench.until(lambda count=count: bench.values()["dropped_on_error"] == str(count))
    bench.tracker.error = None
    bench.offer(3)
    bench.until(lambda: bench.published)
    assert bench.reports == [f"stamp {stamp}: {one_line(error)}" for stamp in (1, 2)]
    assert "\n" not in bench.reports[0] and bench.status.last_set_error() == ""
    assert bench.values()["last_error"] == one_line(error) and bench.worker.fatal is None


def test_an_error_before_the_first_set_is_fatal(bench: Bench) -> None:
    bench.tracker.error = ConfigError("threads: too many")
    bench.worker.start()
    bench.until(lambda: bench.worker.fatal == "threads: too many")
    assert not bench.status.ready


def test_it_waits_until_its_inputs_are_complete(bench: Bench) -> None:
    fitting, bench.prepared = bench.prepared, None
    bench.worker.start()
    bench.offer(1)
    assert not bench.status.ready
    bench.prepared = fitting
    bench.until(lambda: bench.status.ready)
    assert bench.values()["dropped_before_ready"] == "1"


@pytest.mark.parametrize("broken", ["b", "ab"])
def test_an_image_that_cannot_be_decoded_costs_its_camera_only(bench: Bench, broken: str) -> None:
    def some(name: str, view: Any) -> Any:
        if name in broken:
            raise ImageError(f"{name}: too short")
        return decode(name, view)

    assert bench.prepared is not None
    decode = bench.prepared.decode
    bench.prepared = replace(bench.prepared, decode=some)
    bench.worker.start()
    bench.until(lambda: bench.status.ready)
    bench.offer(5)
    expected = [f"stamp 5: {name}: too short" for name in broken]
    bench.until(lambda: bench.reports == expected and (bench.published or broken == "ab"))
    assert [set(one.images) for one in bench.published] == [{"a"}] * (broken == "b")
    assert bench.values()["refused/b"] == "1"


def test_reset_makes_the_tracker_forget(bench: Bench) -> None:
    bench.worker.start()
    bench.until(lambda: bench.status.ready)
    offer_one_by_one(bench, 8, 9)
    assert bench.tracker.resets == 0
    bench.worker.reset()
    offer_one_by_one(bench, 10)
    assert bench.tracker.resets == 1


def test_time_set_back_keeps_the_track_and_uses_no_start_again() -> None:
    bench = Bench(start_ns=2 * FRAME_NS + 300_000)
    bench.worker.start()
    bench.until(lambda: bench.status.ready)
    offer_one_by_one(bench, *(frame * FRAME_NS for frame in range(6)))
    assert bench.values()["dropped_before_start"] == "2"
    bench.offer(0, FRAME_NS)
    offer_one_by_one(bench, *(frame * FRAME_NS for frame in (2, 3)))
    bench.until(lambda: len(bench.published) == 6)
    assert bench.worker.stop(60)
    assert [stamp // FRAME_NS for stamp, _ in bench.tracker.seen] == [2, 3, 4, 5, 2, 3]
    assert bench.tracker.resets == 0 and bench.values()["dropped_before_start"] == "2"
    assert (bench.values()["restarts"], bench.values()["late"]) == ("1", "2")
    assert [line for line in bench.reports if "time was set back" in line]


def test_the_next_set_is_tracked_while_one_is_published(bench: Bench) -> None:
    bench.may_publish.clear()
    bench.worker.start()
    bench.until(lambda: bench.status.ready)
    for count in (1, 2):
        bench.offer(count)
        bench.until(lambda count=count: len(bench.tracker.seen) == count)
    assert not bench.published and not bench.dealt
    bench.may_publish.set()
    bench.until(lambda: len(bench.dealt) == len(bench.published) == 2)


def test_a_result_is_published_with_the_body_of_its_time(bench: Bench) -> None:
    bench.worker.start()
    for stamp in (1, 2):
        bench.until(lambda: bench.status.ready)
        bench.tracker.body = stamp
        offer_one_by_one(bench, stamp)
    bench.until(lambda: len(bench.published) == 2)
    assert [one.body for one in bench.published] == [1, 2]


def test_stop_does_not_wait_for_the_compiler() -> None:
    bench = Bench()
    bench.tracker.compiled.clear()
    bench.worker.start()
    assert not bench.worker.stop(0.05)
    bench.tracker.compiled.set()
    assert bench.worker.stop(60)


def learn(bench: Bench, sets: int = 4) -> Learning:
    learning = Learning(("a", "b"), sets, ImagingSettings(), None)
    bench.worker.learn(learning)
    return learning


def offer_one_by_one(bench: Bench, *stamps: int) -> None:
    for stamp in stamps:
        before = {key: bench.values()[key] for key in KEYS}
        bench.offer(stamp)
        bench.until(lambda before=before: any(bench.values()[k] != v for k, v in before.items()))


def test_sets_become_backgrounds_and_the_first_and_the_last_are_tracked(
    bench: Bench,
) -> None:
    early = learn(bench)
    assert early.answered and early.message == "nothing learned: the tracker is not ready yet"
    bench.tracker.state = TrackState.SEARCHING
    bench.worker.start()
    bench.until(lambda: bench.status.ready)
    learning, second = learn(bench), learn(bench)
    assert second.answered and "already" in second.message
    offer_one_by_one(bench, 1, 2, 3, 4)
    bench.until(lambda: learning.answered)
    assert learning.success and learning.message == "a, b learned from 4 images each"
    assert [stamp for stamp, _ in bench.tracker.seen] == [1, 4]
    assert bench.values()["dropped_while_learning"] == "2"
    assert bench.tracker.backgrounds["b"].note == "learned live from 4 images"
    assert (bench.tracker.backgrounds["b"].mean == 7.0).all()
    offer_one_by_one(bench, 5)
    assert bench.tracker.seen[-1][0] == 5


def test_a_tracked_person_is_not_learned(bench: Bench) -> None:
    bench.worker.start()
    bench.until(lambda: bench.status.ready)
    learning = learn(bench)
    offer_one_by_one(bench, 1)
    bench.until(lambda: learning.answered)
    assert not learning.success and "a person is tracked" in learning.message
    assert not bench.tracker.backgrounds
    # The next request is another one.
    bench.until(lambda: "a person" not in learn(bench).message)


def test_an_error_answers_a_request(bench: Bench) -> None:
    bench.worker.start()
    bench.until(lambda: bench.status.ready)
    bench.tracker.error = ConfigError("a: too dark")
    learning = learn(bench)
    bench.offer(1)
    bench.until(lambda: learning.answered)
    assert learning.message == "nothing learned: a: too dark"
    bench.tracker.error = None
    waiting = learn(bench)
    assert bench.worker.stop(60)
    assert waiting.message == "nothing learned: the tracker ends"


def test_without_backgrounds_sets_are_dropped_until_they_are_learned(bench: Bench) -> None:
    assert bench.prepared is not None
    bench.prepared = replace(bench.prepared, waits=True)
    bench.worker.start()
    bench.until(lambda: bench.status.ready)
    offer_one_by_one(bench, 1, 2)
    assert not bench.tracker.seen
    assert bench.values()["activity"] == "waiting for learn_background"
    learning = learn(bench, 2)
    offer_one_by_one(bench, 3, 4)
    bench.until(lambda: learning.answered)
    assert learning.success and set(bench.tracker.backgrounds) == {"a", "b"}
    offer_one_by_one(bench, 5)
    assert [stamp for stamp, _ in bench.tracker.seen] == [5]
