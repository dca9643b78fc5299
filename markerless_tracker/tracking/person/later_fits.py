"""Further fits of an unmeasured body, made as long as new postures appear.

The first fit uses a short part of the motion. A straight knee and a hanging arm show neither where
the joint lies nor how long the limb is; later poses do.
"""

from collections.abc import Generator

import numpy as np

from markerless_tracker.body import BodyModel
from markerless_tracker.geometry import FloatArray
from markerless_tracker.tracking.person.body_fitting import Unmeasured
from markerless_tracker.tracking.person.spread import posture_angles
from markerless_tracker.tracking.person.whole import WholeRecording
from markerless_tracker.tracking.search import FrameSearch

FIRST = 40
"""Tracked frames before the first of these fits. Their number doubles from each fit to the next."""
STEPS = 5
"""Gauss-Newton steps; few, since a fit begins with the lengths of the one before it."""
VARIETY_RAD = 0.15
"""Least root mean square difference of joint angles by which a posture is new."""
MOST_KNOWN = 64
"""Number of postures after which none counts as new."""


class LaterFits:
    """Keeps frames of the track, and fits the body to the most different ones of them.

    Args:
        person: what is known of the person.
    """

    def __init__(self, person: Unmeasured) -> None:
        self._person = person
        self._frames = WholeRecording()
        self._count = 0
        self._next = FIRST
        self._known: list[FloatArray] = []
        self._learns = False

    def keep(self, search: FrameSearch) -> None:
        """Take a tracked frame that agrees with the body."""
        self._count += 1
        self._frames.keep(search.stamp_ns, search.pose, search.observations)
        if len(self._known) >= MOST_KNOWN:
            return
        posture = search.pose[posture_angles(search.searcher.body)]
        gaps = [np.sqrt(np.mean((posture - known) ** 2)) for known in self._known]
        if min(gaps, default=np.inf) > VARIETY_RAD:
            self._learns = bool(self._known)
            self._known.append(posture)

    def due(self) -> bool:
        """Whether it is time for a fit, and a new posture has come since the last one."""
        return self._learns and self._count >= self._next

    def fit(self, search: FrameSearch) -> Generator[None, None, BodyModel]:
        """A fit in pieces (`WholeRecording.fitting`), begun with the body of a frame's search."""
        self._next = 2 * self._count
        self._learns = False
        return self._frames.fitting(search.searcher, self._person, STEPS)
