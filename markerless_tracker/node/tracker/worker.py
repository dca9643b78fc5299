"""The tracking thread: takes the newest complete set, tracks it, passes on the result."""

import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from functools import partial
from threading import Event, Thread
from typing import Any

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.compiled import compilation
from markerless_tracker.errors import ImageError, one_line
from markerless_tracker.libraries import collect_for_good
from markerless_tracker.node.health import PROCESSING
from markerless_tracker.node.tracker.announcer import CompilingLines, ready_line
from markerless_tracker.node.tracker.handle import Images, TrackedSet, TrackerHandle
from markerless_tracker.node.tracker.learning import Learning, OpenRequest
from markerless_tracker.node.tracker.pace.ahead import Ahead, Taken
from markerless_tracker.node.tracker.pace.effort import EffortRule, Lateness
from markerless_tracker.node.tracker.pace.start_time import StartTimeGate
from markerless_tracker.node.tracker.pace.waiting import MatchedSet
from markerless_tracker.node.tracker.status import TrackerStatus
from markerless_tracker.node.tracker.synchronizer import Synchronizer
from markerless_tracker.records import Observation, TrackResult, TrackState

_POLL_S = 0.2


class TrackWorker:
    """A thread that compiles the kernels, then tracks set after set; another thread publishes.

    No exception leaves the thread: an error in a set is reported and the set is lost; an error
    before the first set ends the worker and is kept in `fatal`.

    Args:
        sets: source of the complete sets.
        status: receives counts, times and errors.
        prepare: makes the `TrackerHandle`; called again while it returns None (an input is
            missing).
        publish: called with each result, in order, in its own thread, while the next set is
            tracked.
        report: called with each error, one line.
        inform: called with a line for the log when a phase begins.
        dealt: called after each set, tracked or dropped, with the time at which it was complete; in
            the thread of `publish`.
        clock: monotonic time in s; the clock of the sets' arrival times.
    """

    def __init__(
        self,
        sets: Synchronizer[Any],
        status: TrackerStatus,
        *,
        prepare: Callable[[], TrackerHandle | None],
        publish: Callable[[TrackedSet], None],
        report: Callable[[str], None],
        inform: Callable[[str], None] = lambda _: None,
        dealt: Callable[[float], None] = lambda _: None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._sets = sets
        self._status = status
        self._prepare = prepare
        self._publish = publish
        self._report = report
        self._inform = inform
        self._dealt = dealt
        self._clock = clock
        self._stop = Event()
        self._reset = Event()
        self._request = OpenRequest()
        self._waits = False
        self._effort = EffortRule()
        self.fatal: str | None = None
        # A daemon: compilation cannot be interrupted and must not keep the process alive.
        self._thread = Thread(target=self._run, name="fit", daemon=True)

    @property
    def learning(self) -> bool:
        """Whether the backgrounds are being learned or must be learned."""
        return self._waits or self._request.current is not None

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def reset(self) -> None:
        """Forget the person before the next set; restart from the start pose if there is one."""
        self._reset.set()

    def learn(self, learning: Learning) -> None:
        """Learn the backgrounds from the next sets of images.

        The request is refused before the worker is ready, and while another is open.
        """
        if not self._status.ready:
            learning.refuse("the tracker is not ready yet")
        else:
            self._request.open(learning)

    def stop(self, timeout_s: float) -> bool:
        """End after the present set; returns whether it has ended.

        Compilation cannot be interrupted, so while compiling it returns soon, with False.
        """
        self._stop.set()
        self._sets.wake()
        if self._thread.ident is not None:
            self._thread.join(timeout_s if self._status.ready else min(timeout_s, _POLL_S))
        return not self._thread.is_alive()

    def _run(self) -> None:
        try:
            handle = self._make()
            if handle is None:
                return
            self._status.doing("compiling")
            begun_s, lines = self._clock(), CompilingLines(self._inform, self._clock)
            with compilation(partial(self._compiling, lines)) as kernels:
                handle.tracker.warm_up()
                handle.warm_up()
            collect_for_good()
        except Exception as error:
            self.fatal = one_line(error)
            self._status.failed(self.fatal)
            return
        # Sets received during compilation are outdated.
        self._status.dropped("before_ready", self._sets.start_counting().complete)
        self._waits = handle.waits
        activity = "waiting for learn_background" if handle.waits else "waiting for images"
        self._status.became_ready(activity, now_s=self._clock())
        self._inform(ready_line(activity, kernels.done, self._clock() - begun_s))
        self._keep_for_search(handle)
        gate = StartTimeGate(handle.start_ns)
        ahead = Ahead(
            self._sets, partial(self._evidence, handle), poll_s=_POLL_S, clock=self._clock
        )
        publishing = ThreadPoolExecutor(1, thread_name_prefix="publish")
        published: Future[None] = publishing.submit(lambda: None)
        while not self._stop.is_set():
            asked_s = self._clock()
            if (taken := ahead.next()) is not None:
                ahead.fitting()
                tracked = self._handle(handle, gate, taken, self._clock() - asked_s)
                ahead.fitted()
                published.result()
                published = publishing.submit(self._give, taken.matched, tracked)
            if (request := self._request.current) is not None:
                request.refuse_if_overdue(self._status.activity)
        self._status.dropped("at_end", ahead.close() + self._sets.drop_all())
        publishing.shutdown()
        if (request := self._request.current) is not None:
            request.refuse("the tracker ends")

    def _compiling(self, lines: CompilingLines, _: str, done: int, most: int) -> None:
        """Report the progress of a first start."""
        activity = f"compiling {done} of at most {most} kernels"
        self._status.doing(activity)
        lines.progress(activity)

    def _make(self) -> TrackerHandle | None:
        while not self._stop.is_set():
            if (handle := self._prepare()) is not None:
                return handle
            self._stop.wait(_POLL_S)
        return None

    def _evidence(self, handle: TrackerHandle, matched: MatchedSet[Any]) -> tuple[Images, Any]:
        """The set's images, and the argument of the tracker's step."""
        images = self._decoded(handle, matched)
        if self.learning:
            return images, images
        return images, handle.tracker.prepare(images, matched.stamp_ns)

    def _handle(
        self, handle: TrackerHandle, gate: StartTimeGate, taken: Taken, waited_s: float
    ) -> TrackedSet | None:
        """Track a set; None if it was dropped or failed."""
        matched = taken.matched
        learning = self._request.current
        try:
            if matched.restarted:
                self._report(
                    f"stamp {matched.stamp_ns}: the images' time was set back; the track goes on"
                )
            if self._reset.is_set():
                self._reset.clear()
                handle.tracker.reset()
                self._keep_for_search(handle)
                self._status.restarted()
            if not gate.admits(matched.stamp_ns):
                self._status.dropped("before_start")
                self._status.doing("waiting for the start frame")
                return None
            if taken.error is not None:
                raise taken.error
            images, views = taken.made
            if learning is None and self._waits:
                self._status.dropped("while_learning")
                self._status.doing("waiting for learn_background")
                return None
            if learning is not None:
                self._status.doing("learning the background")
                learning.take(images)
                if self._waits or not (learning.searches_person or learning.answered):
                    self._status.dropped("while_learning")
                    self._learn(handle, learning, matched.stamp_ns)
                    return None
            else:
                self._status.doing(PROCESSING)
            age_s = max(0.0, self._clock() - matched.arrived_s)
            lateness = Lateness(matched.replaced, waited_s, age_s, matched.period_s)
            try:
                result = handle.tracker.step(views, matched.stamp_ns, self._effort.take(lateness))
            except ImageError:
                # A background of another kind, grey or in colour, is learned anew because of that.
                if learning is None:
                    raise
                self._status.dropped("while_learning")
                self._learn(handle, learning, matched.stamp_ns)
                return None
            finished_s = self._clock()
        except Exception as error:
            # The next set may be usable.
            if learning is not None:
                learning.refuse(one_line(error))
            self._status.record_failed_set(one_line(error))
            self._trouble(matched.stamp_ns, error)
            return None
        self._keep_for(result, handle.kept)
        self._status.tracked(result, arrived_s=matched.arrived_s, finished_s=finished_s)
        tracked = TrackedSet(result, images, handle.tracker.body, handle.tracker.rig)
        if learning is not None:
            learning.saw(result.state)
            self._learn(handle, learning, matched.stamp_ns)
        return tracked

    def _keep_for_search(self, handle: TrackerHandle) -> None:
        """Keep sets from now on if the tracker begins with a search."""
        self._sets.keep(handle.kept if handle.searches else 0)

    def _keep_for(self, result: TrackResult, kept: int) -> None:
        """Keep the sets that come during the search for a person; without a person, the newest.

        A step that gives up a lost person searches, too.
        """
        searching = result.state is not TrackState.TRACKING
        self._sets.keep(kept if searching or result.settling else 0, followed=result.settling)
        if searching:
            self._sets.drop_older()

    def _give(self, matched: MatchedSet[Any], tracked: TrackedSet | None) -> None:
        """Publish a set's result, and note that the set was processed."""
        try:
            if tracked is not None:
                self._publish(tracked)
                self._status.published(self._clock() - matched.arrived_s)
        except Exception as error:
            self._trouble(matched.stamp_ns, error)
        self._status.dealt_with(matched.stamp_ns)
        try:
            self._dealt(matched.arrived_s)
        except Exception as error:
            self._trouble(matched.stamp_ns, error)

    def _decoded(self, handle: TrackerHandle, matched: MatchedSet[Any]) -> Images:
        """The set's images without those that cannot be decoded; an error if none remains."""
        images: dict[str, NDArray[np.uint8] | Observation] = {}
        failed: list[ImageError] = []
        for name, view in matched.views.items():
            try:
                images[name] = handle.decode(name, view)
            except ImageError as error:
                self._status.refused(name)
                failed.append(error)
        # The caller reports an error that is raised.
        raised = failed.pop() if failed and not images else None
        for one in failed:
            self._trouble(matched.stamp_ns, one)
        if raised is not None:
            raise raised
        return images

    def _learn(self, handle: TrackerHandle, learning: Learning, stamp_ns: int) -> None:
        try:
            if learning.finish_if_complete(handle.tracker):
                self._waits = False
                self._keep_for_search(handle)
                self._status.restarted()
        except Exception as error:
            learning.refuse(one_line(error))
            self._trouble(stamp_ns, error)

    def _trouble(self, stamp_ns: int, error: Exception) -> None:
        text = one_line(error)
        self._status.failed(text)
        self._report(f"stamp {stamp_ns}: {text}")
