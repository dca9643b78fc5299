"""The legs exchanged: who walks passes one leg by the other, and both lie in one silhouette there.

Legs that were tracked into each other's place explain the silhouettes nearly as well, for as long
as the step goes on. No search of one leg alone finds both again.
"""

import numpy as np

from markerless_tracker.body import BodyModel, markers
from markerless_tracker.geometry import FloatArray
from markerless_tracker.tracking.start.mirror import mirror_of

LEGS = "legs"
EVERY_NS = 100_000_000
"""The exchange is tried so often: some times within half of a step."""
LEAST_M = 0.1
"""Legs nearer to each other's place, at every marker, need not be exchanged."""
LEAST_GAIN = 0.004
"""Least rise of f_s. Where the legs pass each other both ways fit alike."""
CLOSE = 0.018
"""As of `LimbSearch.compared`: legs in their place cost more when they are exchanged."""


class LegExchange:
    """Tries the exchange of the legs at intervals."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget when it was tried."""
        self._tried_ns: int | None = None

    def due(
        self, body: BodyModel, pose: FloatArray, limits: FloatArray, stamp_ns: int
    ) -> FloatArray | None:
        """The pose (p,) with the legs exchanged, within limits (2, p), if it is to be tried now."""
        if LEGS not in body.subspaces:
            return None
        if self._tried_ns is not None and 0 <= stamp_ns - self._tried_ns < EVERY_NS:
            return None
        legs, other = body.subspaces[LEGS], pose.copy()
        other[legs] = np.clip(mirror_of(body).of(pose)[legs], *limits[:, legs])
        moved_m = np.linalg.norm(markers(body, other) - markers(body, pose), axis=1)
        if moved_m.max() < LEAST_M:
            return None
        self._tried_ns = stamp_ns
        return other
