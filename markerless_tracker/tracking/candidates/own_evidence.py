"""Compares poses, each in the evidence that it decides itself.

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


class OwnEvidence:
    """Costs of poses of one frame, each in its own evidence.

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
        self._last: tuple[FloatArray, FramePopulation] | None = None
        self.body = searcher.body
        self.differs = any(seen.undecided_words is not None for seen in imaged.values())

    @cached_property
    def undecided(self) -> FramePopulation:
        """The evidence before any body decides it: undecided pixels do not count."""
        if not self.differs:
            return self._frame
        return self._population(self._imaged, self._frame.near)

    def cost_with_prior(self, pose: FloatArray) -> float:
        """The cost of a pose (p,) as `FramePopulation.costs_with_prior`; to compare poses."""
        return float(self._decided(pose).costs_with_prior(pose[None])[0])

    def refined(
        self, pose: FloatArray, iterations: int, truncation_m: tuple[float, float]
    ) -> tuple[FloatArray, float]:
        """A pose (p,) refined in its own evidence, and its `cost_with_prior` there.

        Args:
            pose: the initial pose.
            iterations: of the contour refinement.
            truncation_m: residuals beyond it are outliers, in the first and in the last iteration.
        """
        found = self._decided(pose).refined(pose[None], iterations, truncation_m)[0]
        return found, self.cost_with_prior(found)

    def _decided(self, pose: FloatArray) -> FramePopulation:
        """The evidence that the body at a pose (p,) decides; cached for the last pose."""
        if not self.differs:
            return self._frame
        if self._last is None or not np.array_equal(self._last[0], pose):
            decided = decide(self._imaged, self._searcher.cameras, self.body, pose)
            self._last = pose.copy(), self._population(decided, pose)
        return self._last[1]

    def _population(
        self, observations: Mapping[str, Observation], near: FloatArray
    ) -> FramePopulation:
        return FramePopulation(
            self._searcher, observations, self._stamp_ns, near, radius_m=self._radius_m
        )
