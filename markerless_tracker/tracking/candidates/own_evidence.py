"""Compares poses in the evidence that they decide themselves.

Undecided pixels near a body become person. Evidence that was decided with one pose is therefore
biased against every other pose: a wrong leg over a floor of the trousers' colour would be kept.
"""

from collections.abc import Mapping
from functools import cached_property

import numpy as np

from markerless_tracker.fitness.contour import RADIUS_M
from markerless_tracker.geometry import FloatArray
from markerless_tracker.records import Observation
from markerless_tracker.tracking.candidates.population import FramePopulation
from markerless_tracker.tracking.evidence.undecided import decide
from markerless_tracker.tracking.search import Searcher

_CACHED = 4
"""Number of poses whose evidence is kept: the estimate's, another's, and both refined."""


class OwnEvidence:
    """Costs of poses of one frame, in the evidence that each decides.

    Args:
        searcher: the body, the cameras and the settings.
        imaged: the evidence, with the undecided pixels that imaging left.
        stamp_ns: its time.
        frame: the evidence decided so far; used for all poses if imaging left nothing undecided.
        radius_m: as in `FrameSearch`, for evidence made here.

    Attributes:
        body: the body.
        differs: whether imaging left undecided pixels, so that poses differ in their evidence.
    """

    def __init__(
        self,
        searcher: Searcher,
        imaged: Mapping[str, Observation],
        stamp_ns: int,
        frame: FramePopulation,
        *,
        radius_m: float = RADIUS_M,
    ) -> None:
        self._searcher = searcher
        self._imaged = imaged
        self._stamp_ns = stamp_ns
        self._frame = frame
        self._radius_m = radius_m
        self._latest: dict[bytes, FramePopulation] = {}
        self.body = searcher.body
        self.differs = any(seen.undecided_words is not None for seen in imaged.values())

    @cached_property
    def undecided(self) -> FramePopulation:
        """The evidence before any body decides it: undecided pixels do not count."""
        if not self.differs:
            return self._frame
        return self._population(self._imaged, self._frame.near)

    def cost_with_prior(self, pose: FloatArray) -> float:
        """The cost of a pose (p,) in its own evidence, as `FramePopulation.costs_with_prior`."""
        return float(self._decided(pose).costs_with_prior(pose[None])[0])

    def gain(self, pose: FloatArray, other: FloatArray, *, other_share: float = 0.0) -> float:
        """How much less another pose (p,) costs than a pose (p,), with the prior.

        The evidence of two poses can differ in a region that concerns neither pose. So each pose is
        judged in its own evidence or in that of the other pose, where it costs less.

        Args:
            pose, other: the poses.
            other_share: weight of a pose's cost in the evidence of the other pose, beside the
                lesser one, 0 to 1. A pose that leaves a limb's undecided pixels out has no fault in
                its own evidence, but misses the limb in that of the other.
        """
        both = np.stack([pose, other])
        here, there = (self._decided(each).costs_with_prior(both) for each in both)
        costs = (1.0 - other_share) * np.minimum(here, there)
        costs += other_share * np.array([there[0], here[1]])
        return float(costs[0] - costs[1])

    def refined(
        self, pose: FloatArray, iterations: int, truncation_m: tuple[float, float]
    ) -> FloatArray:
        """A pose (p,) refined in its own evidence.

        Args:
            pose: the initial pose.
            iterations: of the contour refinement.
            truncation_m: residuals beyond it are outliers, in the first and in the last iteration.
        """
        refined = self._decided(pose).refined(pose[None], iterations, truncation_m)
        return np.asarray(refined[0])

    def _decided(self, pose: FloatArray) -> FramePopulation:
        """The evidence that the body at a pose (p,) decides; cached for the latest poses."""
        if not self.differs:
            return self._frame
        key = pose.tobytes()
        frame = self._latest.pop(key, None)
        if frame is None:
            decided = decide(self._imaged, self._searcher.cameras, self.body, pose)
            frame = self._population(decided, pose)
        self._latest[key] = frame
        if len(self._latest) > _CACHED:
            del self._latest[next(iter(self._latest))]
        return frame

    def _population(
        self, observations: Mapping[str, Observation], near: FloatArray
    ) -> FramePopulation:
        return FramePopulation(
            self._searcher, observations, self._stamp_ns, near, radius_m=self._radius_m
        )
