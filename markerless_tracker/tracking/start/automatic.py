"""The automatic start as the tracker uses it: in its steps, or beside them."""

from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from markerless_tracker.body import BodyModel, markers
from markerless_tracker.geometry import FloatArray
from markerless_tracker.records import Stage
from markerless_tracker.tracking.config import TrackerConfig
from markerless_tracker.tracking.evidence.seen import Seen
from markerless_tracker.tracking.evidence.undecided import decide
from markerless_tracker.tracking.evidence.views import anybody
from markerless_tracker.tracking.search import Searcher
from markerless_tracker.tracking.stages.frame import contour_stage, frame_stages
from markerless_tracker.tracking.start.estimate import StartEstimate
from markerless_tracker.tracking.start.starter import Starter

SEARCH_NS, REST_NS = 90_000_000, 400_000_000
"""Time from a set that is searched beside the steps to the first set that takes the result; and the
same for what completes a start. Times of the images, so that results do not depend on how long a
search takes."""
_SAME_M = 0.15
"""A pose all of whose markers are nearer than this to another's is the same, improved."""
_EVERY_NS = 45_000_000
"""Another pose is refined in frames this far apart, from the searched one to the present."""


@dataclass(frozen=True, eq=False)
class _Beside:
    """A search beside the steps.

    Attributes:
        future: of what it finds.
        stamp_ns: time of the set from which `taken_ns` counts.
        taken_ns: time until a set takes the result.
        then: (p,) tracked pose of the searched frame.
    """

    future: Future[StartEstimate | None]
    stamp_ns: int
    taken_ns: int
    then: FloatArray

    def due(self, stamp_ns: int) -> bool:
        """Whether a set takes the result; any does if the time ran backwards."""
        return not 0 <= stamp_ns - self.stamp_ns < self.taken_ns


class AutomaticStart:
    """Finds a person, and follows the person until the start is complete.

    With full effort each frame is searched in its step, and so are the first one and one that is
    searched independently. With less effort, other frames are searched beside the steps, and the
    frames after them refine the pose found so far. The first set at least `SEARCH_NS` later takes
    the result, and is searched next. `step` is to be followed by `tracked`.

    Args:
        starter: searches the frames.
        beside: whether frames may be searched beside the steps.
    """

    def __init__(self, starter: Starter, *, beside: bool) -> None:
        self._starter = starter
        self._may = beside
        self._pool = ThreadPoolExecutor(1, thread_name_prefix="start")
        self._forget()

    def _forget(self) -> None:
        self._found: StartEstimate | None = None
        self._beside: _Beside | None = None
        self._next: Seen | None = None
        self._since: list[Seen] = []
        self._followed = False

    @property
    def followed(self) -> bool:
        """Whether the last frame's pose followed from that of the frame before it."""
        return self._followed and self._found is not None

    def follows(self, *, late: bool) -> bool:
        """Whether the next frame's pose follows from that of the last frame.

        Args:
            late: whether the effort is below 1.
        """
        if self._found is None or self._beside is not None:
            return self._found is not None
        # A doubtful first pose is not worth following.
        return late and self._may and not self._starter.searches_again

    def reset(self) -> None:
        """Forget the person; rejected hulls are remembered."""
        self.wait()
        self._starter.reset()
        self._forget()

    def wait(self) -> None:
        """Wait for what runs beside the steps."""
        if self._beside is not None:
            wait([self._beside.future])

    def step(self, seen: Seen, predicted: FloatArray, *, late: bool) -> StartEstimate | None:
        """Search a frame, or follow the person found so far; None if there is none.

        Args:
            seen: the evidence of the whole views; near the predicted pose, if it `follows`.
            predicted: (p,) pose expected in this frame.
            late: whether the effort is below 1; if not, the frame takes a search's result now.

        Raises:
            Exception: raised by a search beside the steps; told once.
        """
        self._followed = self.follows(late=late)
        if not anybody(seen.used):
            beside = self._beside
            self.reset()
            if beside is not None:
                # Nobody takes the result, but an error is reported as that of this frame.
                beside.future.result()
            return None
        return self._follow(seen, predicted, late) if self._followed else self._search(seen)

    def tracked(self, pose: FloatArray) -> None:
        """Take the pose (p,) of the last `step`, whose frame may be searched beside the next."""
        seen, self._next = self._next, None
        if seen is not None:
            search = partial(self._starter.step, seen.imaged, seen.stamp_ns, pose)
            self._begin(search, seen.stamp_ns, SEARCH_NS, pose)

    def _search(self, seen: Seen) -> StartEstimate | None:
        found = self._starter.step(seen.used, seen.stamp_ns)
        if found is not None and found.rest is not None:
            found = replace(found.rest(), notes=found.notes)
        self._found = found
        return found

    def _follow(self, seen: Seen, predicted: FloatArray, late: bool) -> StartEstimate | None:
        assert self._found is not None
        if self._beside is None:
            self._next = seen
        elif not late or self._beside.due(seen.stamp_ns):
            return self._take(self._beside, seen, predicted, late)
        else:
            self._since.append(seen)
        return replace(
            self._found, pose=predicted, observations=seen.used, settled=False, notes=(),
            predicted=True, continued=True,
        )  # fmt: skip

    def _begin(
        self,
        search: Callable[[], StartEstimate | None],
        stamp_ns: int,
        taken_ns: int,
        then: FloatArray,
    ) -> None:
        self._beside = _Beside(self._pool.submit(search), stamp_ns, taken_ns, then)
        self._since = []

    def _take(
        self, beside: _Beside, seen: Seen, predicted: FloatArray, late: bool
    ) -> StartEstimate | None:
        """Take the result of a search."""
        before, self._beside = self._found, None
        self._found = found = beside.future.result()
        if before is None or found is None:
            return None
        searcher = found.searcher
        if _same(searcher.body, found.pose, before.searcher.body, beside.then):
            pose = np.clip(found.pose + predicted - beside.then, *searcher.limits)
        else:
            pose = _followed(searcher, found.pose, self._since)
        if found.rest is not None:
            # It completes the pose of the searched frame, so the frames since that one count.
            since = [*self._since, seen]
            self._begin(found.rest, seen.stamp_ns, REST_NS, found.pose)
            self._since = since
        elif not found.settled and late:
            self._next = seen
        decided = decide(seen.imaged, searcher.cameras, searcher.body, pose)
        return replace(found, pose=pose, observations=decided, predicted=True)


def stages_of(found: StartEstimate, body: BodyModel, config: TrackerConfig) -> tuple[Stage, ...]:
    """The stages that a frame of a start is searched with, from the estimate's pose."""
    if found.settled:
        return frame_stages(body, config, found.pose, body.sigma)
    if found.predicted:
        return (contour_stage("align", body, config, found.pose, body.sigma),)
    return ()


def _same(body: BodyModel, pose: FloatArray, other_body: BodyModel, other: FloatArray) -> bool:
    """Whether poses (p,) of two bodies differ by an improvement alone."""
    gaps_m = np.linalg.norm(markers(body, pose) - markers(other_body, other), axis=1)
    return float(gaps_m.max()) <= _SAME_M


def _followed(searcher: Searcher, pose: FloatArray, frames: Sequence[Seen]) -> FloatArray:
    """A pose (p,) of an earlier frame, refined in the frames since, `_EVERY_NS` apart."""
    last_ns: int | None = None
    for seen in frames:
        if last_ns is not None and 0 <= seen.stamp_ns - last_ns < _EVERY_NS:
            continue
        last_ns, body = seen.stamp_ns, searcher.body
        decided = decide(seen.imaged, searcher.cameras, body, pose)
        search = searcher.frame(decided, seen.stamp_ns, pose, radius_m=searcher.tracked_radius_m)
        pose = search.run((contour_stage("align", body, searcher.config, pose, body.sigma),))
    return pose
