"""Checks the heading of the tracked person against other headings.

The opposite heading gives nearly the same silhouettes; in loose clothes a heading sideways does,
too. So a start may be wrong, and a rotation of the person may be missed. One frame does not decide;
the mean over many does.
"""

from collections.abc import Callable

import numpy as np

from markerless_tracker.body import BodyModel
from markerless_tracker.geometry import FloatArray
from markerless_tracker.tracking.candidates.mirror import opposite_heading, rotated_by
from markerless_tracker.tracking.limbs.gains import GainSum
from markerless_tracker.tracking.limbs.search import LimbSearch

EVERY_NS, FIRST_EVERY_NS, DOUBTED_EVERY_NS = 600_000_000, 250_000_000, 80_000_000
"""Time between two comparisons: usually; in the first `FIRST_NS`, since a start may be wrong; and
while some sum of gains is positive."""
FIRST_NS = 2_000_000_000
LEAST_GAIN = 0.02
"""Least sum of the gains, over comparisons, for which another heading is taken."""
LEAST_COMPARISONS = 3
"""Least number of comparisons in this sum."""
CLOSE = 0.03
"""Argument of `LimbSearch.compared`."""


def _reversed(body: BodyModel, pose: FloatArray) -> FloatArray:
    return opposite_heading(body).of(pose)


def _to_the_left(body: BodyModel, pose: FloatArray) -> FloatArray:
    return rotated_by(body, pose, 0.5 * np.pi, about=pose)


def _to_the_right(body: BodyModel, pose: FloatArray) -> FloatArray:
    return rotated_by(body, pose, -0.5 * np.pi, about=pose)


_ROTATIONS: tuple[Callable[[BodyModel, FloatArray], FloatArray], ...] = (
    _reversed, _to_the_left, _to_the_right,
)  # fmt: skip


class FacingWatch:
    """Sums the gains of three other headings: the opposite one, and a quarter to each side.

    Each comparison tests one heading, in rotation; the heading with the best mean is taken.
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
        self._gains = [GainSum() for _ in _ROTATIONS]

    def take_due(self, stamp_ns: int) -> bool:
        """Whether to compare at this time; if so, the time is noted as that of a comparison."""
        if self._began_ns is None:
            self._began_ns = stamp_ns
        since = self._compared_ns
        every_ns = FIRST_EVERY_NS if 0 <= stamp_ns - self._began_ns < FIRST_NS else EVERY_NS
        if any(gains.total > 0.0 for gains in self._gains):
            every_ns = DOUBTED_EVERY_NS
        due = since is None or not 0 <= stamp_ns - since < every_ns
        if due:
            self._compared_ns = stamp_ns
        return due

    def compare(self, search: LimbSearch, body: BodyModel, limits: FloatArray) -> FloatArray | None:
        """Compare one heading; the pose (p,) with it, if it has been better for long enough.

        Args:
            search: of the frame, with the estimate.
            body: the body.
            limits: (2, p).
        """
        index, self._next = self._next, (self._next + 1) % len(_ROTATIONS)
        other, gain = search.compared(np.clip(_ROTATIONS[index](body, search.pose), *limits), CLOSE)
        gains = self._gains[index]
        gains.add(gain)
        sure = gains.total >= LEAST_GAIN and gains.count >= LEAST_COMPARISONS
        if not sure or gain <= 0.0 or gains.mean < max(each.mean for each in self._gains):
            return None
        self._begin()
        return other
