"""Exchange of both legs or both arms, which may be confused when they pass each other in a walk.

While they pass, one silhouette covers both. Legs or arms that are tracked into each other's place
explain the silhouettes nearly as well until the step ends. A search of a single limb cannot correct
both.
"""

from typing import NamedTuple

import numpy as np

from markerless_tracker.body import BodyModel
from markerless_tracker.geometry import FloatArray
from markerless_tracker.tracking.candidates.crossed import (
    PAIRS,
    in_each_others_place,
    is_crossed,
    mirrored,
)
from markerless_tracker.tracking.limbs.gains import GainSum
from markerless_tracker.tracking.limbs.search import distance_m

EVERY_NS = 50_000_000
"""Interval at which an exchange is tried, of the two pairs in rotation. Each is tried several times
within half a step."""
LEAST_M = 0.1
"""An exchange that moves no marker farther than this is not tried."""
LEAST_GAIN, LEAST_GAIN_PLACED = 0.004, 0.008
"""Least gain of exchanged angles, and of limbs in each other's place. While the limbs pass each
other, both poses fit alike, and in each other's place more so."""
LEAST_SUM, LEAST_COMPARISONS = 0.008, 3
"""Least sum of smaller gains for which an exchange is taken, and least number of comparisons in it.
If arms reach through the trunk into each other's place, the silhouettes hardly show it."""
CLOSE = 0.018
"""Argument of `LimbSearch.compared`. Exchanging limbs that are right costs more than this."""


class Exchange(NamedTuple):
    """An exchange that is due.

    Attributes:
        name: of the pair.
        poses: (n, p) with the pair exchanged, one or two.
        least_gains: least gain for which each is taken; 0 if it uncrosses the pair.
    """

    name: str
    poses: FloatArray
    least_gains: tuple[float, ...]


class PairExchange:
    """Proposes the exchange of the legs or of the arms at intervals, and decides on it.

    A single frame decides if the gain is clear. Smaller gains are summed.
    """

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget all trials."""
        self._tried_ns: int | None = None
        self._next = 0
        self.forget_gains()

    def forget_gains(self) -> None:
        """Forget all gains: left and right are no longer what they were."""
        self._gains = {name: GainSum() for name in PAIRS}

    def take_due(
        self, body: BodyModel, pose: FloatArray, limits: FloatArray, stamp_ns: int
    ) -> Exchange | None:
        """The exchange of a pair in a pose (p,), within limits (2, p), if one is due.

        The time is noted as that of a trial.
        """
        if self._tried_ns is not None and 0 <= stamp_ns - self._tried_ns < EVERY_NS:
            return None
        for offset in range(len(PAIRS)):
            name = PAIRS[(self._next + offset) % len(PAIRS)]
            other = _exchanged(name, body, pose, limits)
            if other is not None:
                self._tried_ns = stamp_ns
                self._next = PAIRS.index(name) + 1
                return other
        return None

    def add_comparison(self, name: str, gain: float, least_gain: float, moved_m: float) -> bool:
        """Note the gain of an exchange over the estimate; return whether to take the exchange.

        Args:
            name: of the pair.
            gain: as of `LimbSearch.compared`.
            least_gain: the exchange's own, of which one comparison is enough.
            moved_m: farthest marker between the refined exchange and the estimate. An exchange that
                was refined back to the estimate tells nothing and is not taken.
        """
        apart = moved_m >= LEAST_M
        known = gain if apart else 0.0
        gains = self._gains[name]
        gains.add(known)
        summed = known > 0.0 and gains.total >= LEAST_SUM and gains.count >= LEAST_COMPARISONS
        taken = (apart and gain >= least_gain) or summed
        if taken:
            self._gains[name] = GainSum()
        return taken


def _exchanged(name: str, body: BodyModel, pose: FloatArray, limits: FloatArray) -> Exchange | None:
    """A pair exchanged in a pose (p,), unless that changes nothing.

    Its joint angles are exchanged, or its limbs take each other's place. That is not the same where
    the trunk leans or turns. The angles of crossed limbs are not exchanged, as that leaves them
    crossed.
    """
    if name not in body.subspaces:
        return None
    if is_crossed(body, pose, name):
        placed = in_each_others_place(body, pose, name, limits)
        least_gain = LEAST_GAIN if is_crossed(body, placed, name) else 0.0
        moves = distance_m(body, pose, placed) >= LEAST_M
        return Exchange(name, placed[None], (least_gain,)) if moves else None
    mirror = mirrored(body, pose, name, limits)
    if distance_m(body, pose, mirror) < LEAST_M:
        return None
    placed = in_each_others_place(body, pose, name, limits)
    return Exchange(name, np.array([mirror, placed]), (LEAST_GAIN, LEAST_GAIN_PLACED))
