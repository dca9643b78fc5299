"""The one thread that fits: takes the newest complete set, steps, hands on the result."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from threading import Event, Thread
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.errors import TrackerError
from markerless_tracker.imaging import BackgroundModel
from markerless_tracker.node.tracker.learning import Learning
from markerless_tracker.node.tracker.status import TrackerStatus
from markerless_tracker.node.tracker.synchronizer import MatchedSet, Synchronizer
from markerless_tracker.records import TrackResult

Images = Mapping[str, NDArray[np.uint8]]

START_TOLERANCE_NS = 4_000_000
"""A frame this much before the start row's time is the start frame: marker files round their times,
and frames lie further apart (8.3 ms at 120 fps)."""

_POLL_S = 0.2


class Stepper(Protocol):
    """What the worker needs of a `tracking.Tracker`."""

    def warm_up(self) -> None:
        """Compile everything a step needs."""

    def step(self, views: Mapping[str, Any], stamp_ns: int) -> TrackResult:
        """Track one set of images."""

    def reset(self) -> None:
        """Forget the person."""

    def take_backgrounds(self, backgrounds: Mapping[str, BackgroundModel]) -> None:
        """Tell the person from other empty scenes from now on, and forget him."""


class StartGate:
    """Lets sets through from the start row's time on.

    "Arrives" means: a set no later than that time comes first. A stream that is already past it,
    or no time at all, begins with its first complete set.

    Args:
        start_ns: the start row's time, None if there is none.
    """

    def __init__(self, start_ns: int | None) -> None:
        self._start_ns = start_ns
        self._open = start_ns is None

    def admits(self, stamp_ns: int) -> bool:
        """Whether a set of that stamp is to be tracked."""
        if not self._open and self._start_ns is not None:
            self._open = stamp_ns >= self._start_ns - START_TOLERANCE_NS
        return self._open

    def close(self) -> None:
        """Wait for the start again."""
        self._open = self._start_ns is None


@dataclass(frozen=True)
class TrackedSet:
    """A result and the images it came from (scaled, as the tracker saw them)."""

    result: TrackResult
    images: Images


@dataclass(frozen=True)
class TrackerHandle:
    """What the worker works with, once it can be made.

    Attributes:
        tracker: steps on the images.
        start_ns: see `StartGate`.
        decode: a set's view of a camera to the image that the tracker wants.
        waits: the tracker has no backgrounds; sets are dropped until they are learned.
    """

    tracker: Stepper
    start_ns: int | None
    decode: Callable[[str, Any], NDArray[np.uint8]]
    waits: bool = False


class TrackWorker:
    """A thread that compiles, then tracks whatever set is newest.

    No exception leaves the thread: what goes wrong with one set is reported and costs that set;
    what goes wrong before the first set ends the worker and is kept in `fatal`.

    Args:
        sets: where the complete sets come from.
        status: told of everything.
        prepare: makes the `TrackerHandle`; None while an input is missing, then called again.
        publish: called in the worker's thread with each result.
        report: called with each new error, one line.
        clock: seconds that only go forward, the clock of the sets' arrival.
    """

    def __init__(
        self,
        sets: Synchronizer[Any],
        status: TrackerStatus,
        *,
        prepare: Callable[[], TrackerHandle | None],
        publish: Callable[[TrackedSet], None],
        report: Callable[[str], None],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._sets = sets
        self._status = status
        self._prepare = prepare
        self._publish = publish
        self._report = report
        self._clock = clock
        self._stop = Event()
        self._reset = Event()
        self._learning: Learning | None = None
        self._waits = False
        self.fatal: str | None = None
        # A compiler at work cannot be interrupted; it must not keep the process from ending.
        self._thread = Thread(target=self._run, name="fit", daemon=True)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def reset(self) -> None:
        """Forget the person before the next set."""
        self._reset.set()

    def learn(self, learning: Learning) -> None:
        """Let the next sets of images become the backgrounds.

        The request is refused before the worker is ready and while there is another.
        """
        if not self._status.ready:
            learning.refuse("the tracker is not ready yet")
        elif self._learning is not None and not self._learning.answered:
            learning.refuse("the backgrounds are being learned already")
        else:
            self._learning = learning

    def stop(self, timeout_s: float) -> bool:
        """Finish the set at hand and end; returns whether the thread ended in time."""
        self._stop.set()
        self._sets.wake()
        if self._thread.ident is not None:
            self._thread.join(timeout_s)
        return not self._thread.is_alive()

    def _run(self) -> None:
        try:
            fitting = self._make()
            if fitting is None:
                return
            self._status.doing("compiling", ready=False)
            fitting.tracker.warm_up()
        except Exception as error:
            self.fatal = one_line(error)
            self._status.failed(self.fatal)
            return
        # What came meanwhile is old by now.
        self._status.dropped("before_ready", self._sets.start_counting().complete)
        self._status.doing("waiting for images", ready=True)
        gate = StartGate(fitting.start_ns)
        self._waits = fitting.waits
        while not self._stop.is_set():
            matched = self._sets.take(_POLL_S)
            if matched is not None:
                self._handle(fitting, gate, matched)
            self._end_learning()
        if self._learning is not None:
            self._learning.refuse("the tracker ends")

    def _end_learning(self) -> None:
        if self._learning is not None:
            self._learning.refuse_if_overdue(self._status.activity)
            if self._learning.answered:
                self._learning = None

    def _make(self) -> TrackerHandle | None:
        while not self._stop.is_set():
            fitting = self._prepare()
            if fitting is not None:
                return fitting
            self._stop.wait(_POLL_S)
        return None

    def _handle(self, fitting: TrackerHandle, gate: StartGate, matched: MatchedSet[Any]) -> None:
        try:
            if matched.restarted:
                gate.close()
            if self._reset.is_set() or matched.restarted:
                self._reset.clear()
                fitting.tracker.reset()
                self._status.restarted()
            if not gate.admits(matched.stamp_ns):
                self._status.dropped("before_start")
                self._status.doing("waiting for the start frame")
                return
            images = {name: fitting.decode(name, view) for name, view in matched.views.items()}
            learning = self._learning
            if learning is None and self._waits:
                self._status.dropped("while_learning")
                self._status.doing("waiting for learn_background")
                return
            if learning is not None:
                self._status.doing("learning the background")
                learning.take(images)
                if self._waits or not (learning.looks or learning.answered):
                    self._status.dropped("while_learning")
                    self._learn(fitting, learning, matched.stamp_ns)
                    return
            else:
                self._status.doing("tracking")
            result = fitting.tracker.step(images, matched.stamp_ns)
            finished_s = self._clock()
        except Exception as error:
            # Whatever one set provokes, the next may be fine; the node goes on and says so.
            if self._learning is not None:
                self._learning.refuse(one_line(error))
            self._status.dropped("error")
            self._trouble(matched.stamp_ns, error)
            return
        self._status.tracked(result, arrived_s=matched.arrived_s, finished_s=finished_s)
        try:
            self._publish(TrackedSet(result, images))
        except Exception as error:
            self._trouble(matched.stamp_ns, error)
        if learning is not None:
            learning.saw(result.state)
            self._learn(fitting, learning, matched.stamp_ns)

    def _learn(self, fitting: TrackerHandle, learning: Learning, stamp_ns: int) -> None:
        try:
            if learning.finish_if_complete(fitting.tracker):
                self._waits = False
                self._status.restarted()
        except Exception as error:
            learning.refuse(one_line(error))
            self._trouble(stamp_ns, error)

    def _trouble(self, stamp_ns: int, error: Exception) -> None:
        text = one_line(error)
        if self._status.failed(text):
            self._report(f"stamp {stamp_ns}: {text}")


def one_line(error: BaseException) -> str:
    """An error in one line; ours speak for themselves, others are named."""
    text = " ".join(str(error).split())
    return text if isinstance(error, TrackerError) else f"{type(error).__name__}: {text}"
