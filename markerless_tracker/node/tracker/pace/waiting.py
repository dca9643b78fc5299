"""The sets that wait for the worker: the newest alone, or some of those before it, too."""

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Generic, TypeVar

View = TypeVar("View")

SPACING_NS = 80_000_000
"""Time between two sets that are kept: a pose is refined across it without a wider search."""
AT_MOST, MOST_BYTES = 48, 400_000_000
"""Sets that are kept, and the size of their images: a long search must not fill the memory."""
CLOSE = 8
"""Sets that stay as close as they are when there are too many: the start needs so many."""
PLACE_NS = 250_000_000
"""Time in which a place is lost while the worker catches up."""
_SPARE = 2
"""Places beyond those needed when that begins: a long step must not cost sets."""


@dataclass(frozen=True)
class MatchedSet(Generic[View]):
    """One view of every camera that sends.

    Attributes:
        stamp_ns: the earliest of their stamps.
        views: by camera, in the order of the cameras.
        arrived_s: when the last of them came, in the caller's clock.
        restarted: stamps were set back since the last set handed out (a bag was played again).
        replaced: complete sets that this one replaced since the last set handed out.
        period_s: time since the set before it was complete, 0 for the first.
    """

    stamp_ns: int
    views: Mapping[str, View]
    arrived_s: float
    restarted: bool
    replaced: int = 0
    period_s: float = 0.0

    def replacing(self, other: "MatchedSet[View]") -> "MatchedSet[View]":
        """This set, handed out instead of another."""
        return replace(
            self,
            restarted=self.restarted or other.restarted,
            replaced=self.replaced + other.replaced + 1,
        )


def kept_sets(set_bytes: int) -> int:
    """How many sets to keep whose images have that size."""
    return max(1, min(AT_MOST, MOST_BYTES // max(1, set_bytes)))


class WaitingSets(Generic[View]):
    """The newest set; while sets are kept, also earlier ones that lie `SPACING_NS` apart.

    An automatic start searches its first set for about a second, and needs further sets that lie
    near to the first and to each other. So they are kept meanwhile and handed out in their order.
    If there are too many, every other of the later ones is dropped, and the next lie twice as far
    apart. Then the worker catches up: there are fewer and fewer places, until only the newest set
    waits.
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
        """Number of views in all the sets."""
        return sum(len(matched.views) for matched in self._sets)

    def __len__(self) -> int:
        return len(self._sets)

    def keep(self, at_most: int) -> None:
        """Keep so many sets from now on; 0: let the worker catch up, and keep none in the end."""
        if at_most:
            self._places = at_most
            if not self._keeping:
                self._spacing_ns = SPACING_NS
        elif self._keeping:
            self._places = min(self._places, len(self._sets) + _SPARE)
            self._caught_up_ns = self._newest_ns + self._places * PLACE_NS
        self._keeping = at_most > 0

    def put(self, matched: MatchedSet[View]) -> int:
        """Add the newest set; returns how many it replaced."""
        before = len(self._sets) + 1
        self._newest_ns = matched.stamp_ns
        if not self._keeping:
            # Sets of a time that was set back do not continue those that wait.
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
        """The set to track next, once; None if none waits."""
        if not self._sets:
            return None
        taken = self._sets.popleft()
        self._taken_ns = taken.stamp_ns
        return taken

    def drop_older(self) -> int:
        """Keep the newest set alone of those that wait; returns how many were dropped."""
        before = len(self._sets)
        self._drop_to(1)
        return before - len(self._sets)

    def clear(self) -> None:
        """Drop all of them."""
        self._sets.clear()

    def _spaced(self) -> bool:
        """Whether the newest set that waits lies far enough from the one before it to stay."""
        if self._places == 1:
            return False
        before_ns = self._sets[-2].stamp_ns if len(self._sets) > 1 else self._taken_ns
        return before_ns is None or self._sets[-1].stamp_ns - before_ns >= self._spacing_ns

    def _thin_out(self) -> None:
        """Drop every other set of the later ones but the newest."""
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
