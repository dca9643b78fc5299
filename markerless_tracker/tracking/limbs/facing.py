"""Whether the person faces another way: compared while the person is tracked.

A person facing the opposite way gives nearly the same silhouettes, and in loose clothes one facing
sideways does, too, so that a start may be wrong and a turn may be missed. One frame does not tell;
the mean of many does.
"""

from collections.abc import Callable

import numpy as np

from markerless_tracker.body import BodyModel
from markerless_tracker.geometry import FloatArray
from markerless_tracker.tracking.limbs.search import LimbSearch
from markerless_tracker.tracking.start.mirror import turned_by, turned_round

EVERY_NS, FIRST_EVERY_NS, DOUBTED_EVERY_NS = 600_000_000, 250_000_000, 80_000_000
"""Time between two comparisons; in the first `FIRST_NS`, since a start may be wrong; and while one
spoke for another way."""
FIRST_NS = 2_000_000_000
LEAST_GAIN = 0.02
"""Sum of the rises of f_s, over comparisons, from which on the person is turned."""
LEAST_COMPARISONS = 3
CLOSE = 0.03
"""As of `LimbSearch.compared`."""
_FORGET = 0.9
"""Factor of the earlier sum in each comparison."""


def _around(body: BodyModel, pose: FloatArray) -> FloatArray:
    return turned_round(body).of(pose)


def _to_the_left(body: BodyModel, pose: FloatArray) -> FloatArray:
    return turned_by(body, pose, 0.5 * np.pi, about=pose)


def _to_the_right(body: BodyModel, pose: FloatArray) -> FloatArray:
    return turned_by(body, pose, -0.5 * np.pi, about=pose)


_TURNS: tuple[Callable[[BodyModel, FloatArray], FloatArray], ...] = (
    _around, _to_the_left, _to_the_right,
)  # fmt: skip


class FacingWatch:
    """Sums up how much better the person turned explains the views, for each of three turns.

    A turn that fits worse counts fully against it, so that a few frames decide nothing. They are
    compared one after the other, so that the best one is taken.
    """

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget all comparisons."""
        self._began_ns: int | None = None
        self._begin()

    def _begin(self) -> None:
        self._compared_ns: int | None = None
        self._next = 0
        self._gains = [0.0] * len(_TURNS)
        self._counts = [0] * len(_TURNS)

    def due(self, stamp_ns: int) -> bool:
        """Whether to compare at this time; if so, it is noted."""
        if self._began_ns is None:
            self._began_ns = stamp_ns
        since = self._compared_ns
        every_ns = FIRST_EVERY_NS if 0 <= stamp_ns - self._began_ns < FIRST_NS else EVERY_NS
        if max(self._gains) > 0.0:
            every_ns = DOUBTED_EVERY_NS
        due = since is None or not 0 <= stamp_ns - since < every_ns
        if due:
            self._compared_ns = stamp_ns
        return due

    def compare(self, search: LimbSearch, body: BodyModel, limits: FloatArray) -> FloatArray | None:
        """The pose (p,) turned, once that turn has been better for long enough; else None.

        Args:
            search: of the frame, with the estimate.
            body: the body.
            limits: (2, p).
        """
        turn, self._next = self._next, (self._next + 1) % len(_TURNS)
        other, gain = search.compared(np.clip(_TURNS[turn](body, search.pose), *limits), CLOSE)
        total = max(0.0, _FORGET * self._gains[turn] + gain)
        self._gains[turn] = total
        self._counts[turn] = self._counts[turn] + 1 if total > 0.0 else 0
        means = [g / max(1, count) for g, count in zip(self._gains, self._counts, strict=True)]
        sure = total >= LEAST_GAIN and self._counts[turn] >= LEAST_COMPARISONS
        if not sure or gain <= 0.0 or means[turn] < max(means):
            return None
        self._begin()
        return other
