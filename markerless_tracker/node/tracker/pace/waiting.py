"""The sets that wait for the worker: only the newest, or some of the earlier ones, too."""

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Generic, TypeVar

View = TypeVar("View")

SPACING_NS, FOLLOWED_SPACING_NS = 45_000_000, 80_000_000
"""Time between two kept sets, across which a pose is refined without a wider search: of those that
come before the person is found, and of later ones, so that the worker catches up."""
AT_MOST, MOST_BYTES = 48, 400_000_000
"""Largest number of kept sets, and of the bytes of their images, so that a long search does not
fill the memory."""
CLOSE = 8
"""Number of the first kept sets that are never thinned out: the frames of an automatic start."""
PLACE_NS = 250_000_000
"""While the worker catches up, one place less is kept after each such time."""
_SPARE = 2
"""Spare places when catching up begins, so that a long step does not lose sets."""


@dataclass(frozen=True)
class MatchedSet(Generic[View]):
    """A set: one view of every camera that sends.

    Attributes:
        stamp_ns: the earliest stamp of the views.
        views: by camera, in the order of the cameras.
        arrived_s: time at which the last view came, of the caller's clock.
        restarted: whether stamps ran backwards since the last set that was taken (a bag restarted).
        replaced: number of complete sets replaced since the last set that was taken.
        period_s: time from the completion of the set before to that of this set; 0 for the first.
    """

    stamp_ns: int
    views: Mapping[str, View]
    arrived_s: float
    restarted: bool
    replaced: int = 0
    period_s: float = 0.0

    def replacing(self, other: "MatchedSet[View]") -> "MatchedSet[View]":
        """This set, returned instead of another."""
        return replace(
            self,
            restarted=self.restarted or other.restarted,
            replaced=self.replaced + other.replaced + 1,
        )


def kept_sets(set_bytes: int) -> int:
    """Number of sets to keep, given the size of a set's images."""
    return max(1, min(AT_MOST, MOST_BYTES // max(1, set_bytes)))


class WaitingSets(Generic[View]):
    """The newest set; while sets are kept, also earlier sets at intervals.

    An automatic start searches its first set for some time, and then needs sets near in time to
    the first and to each other. So sets are kept meanwhile and returned in their order. If there
    are too many, every second of the later sets is dropped, and the interval doubles. Afterwards
    the worker catches up: the number of places falls until only the newest set waits.
    """

    def __init__(self) -> None:
        self._sets: deque[MatchedSet[View]] = deque()
        self._keeping = False
        self._places = 1
        self._spacing_ns = SPACING_NS
        self._caught_up_ns = 0
        self._newest_ns = 0
        self._taken_ns: int | None = None

    @property
    def views(self) -> int:
        """Number of views in all sets."""
        return sum(len(matched.views) for matched in self._sets)

    def __len__(self) -> int:
        return len(self._sets)

    def keep(self, at_most: int, *, followed: bool = False) -> None:
        """Keep at most `at_most` sets from now on; 0: let the worker catch up, then keep none.

        Args:
            at_most: number of sets.
            followed: whether the person was found, and sets are tracked in turn.
        """
        if at_most:
            self._places = at_most
            if not (followed and self._keeping):
                self._spacing_ns = SPACING_NS
            if followed:
                self._spacing_ns = max(self._spacing_ns, FOLLOWED_SPACING_NS)
        elif self._keeping:
            behind = len(self._sets) > 1
            self._places = min(self._places, len(self._sets) + _SPARE) if behind else 1
            self._caught_up_ns = self._newest_ns + self._places * PLACE_NS
        self._keeping = at_most > 0

    def put(self, matched: MatchedSet[View]) -> int:
        """Add the newest set; returns the number of sets that it replaced."""
        before = len(self._sets) + 1
        self._newest_ns = matched.stamp_ns
        if matched.restarted:
            # The stamps ran backwards: the new set does not continue the waiting sets.
            self._taken_ns, self._spacing_ns = None, SPACING_NS
            while self._sets:
                matched = matched.replacing(self._sets.pop())
        if not self._keeping:
            left = -(-(self._caught_up_ns - matched.stamp_ns) // PLACE_NS)
            self._places = 1 if matched.restarted else max(1, min(self._places, left))
        if self._sets and not self._spaced():
            matched = matched.replacing(self._sets.pop())
        self._sets.append(matched)
        if self._keeping and len(self._sets) > max(self._places, CLOSE + 1):
            self._thin_out()
        self._drop_to(self._places)
        return before - len(self._sets)

    def take(self) -> MatchedSet[View] | None:
        """Remove and return the set to track next; None if none waits."""
        if not self._sets:
            return None
        taken = self._sets.popleft()
        self._taken_ns = taken.stamp_ns
        return taken

    def drop_older(self) -> int:
        """Drop all sets but the newest; returns the number of dropped sets."""
        before = len(self._sets)
        self._drop_to(1)
        return before - len(self._sets)

    def clear(self) -> None:
        """Drop all sets."""
        self._sets.clear()

    def _spaced(self) -> bool:
        """Whether the newest set is far enough from the set before it to be kept."""
        if self._places == 1:
            return False
        before_ns = self._sets[-2].stamp_ns if len(self._sets) > 1 else self._taken_ns
        return before_ns is None or self._sets[-1].stamp_ns - before_ns >= self._spacing_ns

    def _thin_out(self) -> None:
        """Drop every second of the later sets, but not the newest."""
        kept = list(self._sets)[:CLOSE]
        later = list(self._sets)[CLOSE:]
        while later:
            dropped = later.pop(0)
            kept.append(later.pop(0).replacing(dropped) if later else dropped)
        self._sets = deque(kept)
        self._spacing_ns *= 2

    def _drop_to(self, places: int) -> None:
        while len(self._sets) > places:
            oldest = self._sets.popleft()
            self._sets[0] = self._sets[0].replacing(oldest)
