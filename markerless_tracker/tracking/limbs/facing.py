"""Whether the person faces the other way: compared while the person is tracked.

A person facing the opposite way gives nearly the same silhouettes, so that a start may be wrong and
a turn may be missed. One frame does not tell; the mean of many does.
"""

import numpy as np

from markerless_tracker.body import BodyModel
from markerless_tracker.geometry import FloatArray
from markerless_tracker.tracking.limbs.search import LimbSearch
from markerless_tracker.tracking.start.mirror import turned_round

EVERY_NS, DOUBTED_EVERY_NS = 600_000_000, 250_000_000
"""Time between two comparisons; where the last one spoke for the other way."""
LEAST_GAIN = 0.02
"""Sum of the rises of f_s, over comparisons, from which on the person is turned round."""
LEAST_COMPARISONS = 3
CLOSE = 0.03
"""As of `LimbSearch.compared`."""
_FORGET = 0.9
"""Factor of the earlier sum in each comparison."""


class FacingWatch:
    """Sums up how much better the person turned round explains the views.

    A pose that fits worse counts fully against it, so that a few frames decide nothing.
    """

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget all comparisons."""
        self._compared_ns: int | None = None
        self._gain = 0.0
        self._count = 0

    def due(self, stamp_ns: int) -> bool:
        """Whether to compare at this time; if so, it is noted."""
        since = self._compared_ns
        every_ns = DOUBTED_EVERY_NS if self._gain > 0.0 else EVERY_NS
        due = since is None or not 0 <= stamp_ns - since < every_ns
        if due:
            self._compared_ns = stamp_ns
        return due

    def compare(self, search: LimbSearch, body: BodyModel, limits: FloatArray) -> FloatArray | None:
        """The pose (p,) turned round, once it has been better for long enough; else None.

        Args:
            search: of the frame, with the estimate.
            body: the body.
            limits: (2, p).
        """
        other = np.clip(turned_round(body).of(search.pose), *limits)
        other, gain = search.compared(other, CLOSE)
        self._gain = max(0.0, _FORGET * self._gain + gain)
        self._count = self._count + 1 if self._gain > 0.0 else 0
        if self._gain < LEAST_GAIN or self._count < LEAST_COMPARISONS or gain <= 0.0:
            return None
        self.reset()
        return other
