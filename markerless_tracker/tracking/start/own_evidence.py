"""Poses compared with each other, each in the evidence that its body decides.

Undecided pixels near a body become person. Evidence that was decided for one pose therefore speaks
against every other one: a leg that was found wrong on a floor of its trousers' colour would stay.
"""

from collections.abc import Mapping
from functools import cached_property

from markerless_tracker.geometry import FloatArray
from markerless_tracker.records import Observation
from markerless_tracker.tracking.evidence.undecided import decide
from markerless_tracker.tracking.search import Searcher
from markerless_tracker.tracking.start.population import FramePopulation


class OwnEvidence:
    """Costs of poses of one frame, each in its own evidence.

    Args:
        searcher: the body, the cameras and the settings.
        imaged: the evidence, with the undecided pixels that imaging left.
        stamp_ns: its time.
        frame: the evidence as decided so far; it serves all poses where nothing was undecided.

    Attributes:
        body: the body.
        differs: whether anything is undecided, so that poses differ in their evidence.
    """

    def __init__(
        self,
        searcher: Searcher,
        imaged: Mapping[str, Observation],
        stamp_ns: int,
        frame: FramePopulation,
    ) -> None:
        self._searcher = searcher
        self._imaged = imaged
        self._stamp_ns = stamp_ns
        self._frame = frame
        self.body = searcher.body
        self.differs = any(seen.undecided_words is not None for seen in imaged.values())

    @cached_property
    def undecided(self) -> FramePopulation:
        """The evidence that no body decided: undecided pixels count for no pose."""
        if not self.differs:
            return self._frame
        return FramePopulation(self._searcher, self._imaged, self._stamp_ns, self._frame.near)

    def cost(self, pose: FloatArray) -> float:
        """1 - f_s of a pose (p,)."""
        return float(self._decided(pose).costs(pose[None])[0])

    def refined(
        self, pose: FloatArray, iterations: int, truncation_m: tuple[float, float]
    ) -> tuple[FloatArray, float]:
        """A pose (p,) refined in its own evidence, and its cost there.

        Args:
            pose: where to begin.
            iterations: of the contour refinement.
            truncation_m: residuals beyond it are outliers, in the first and in the last iteration.
        """
        found = self._decided(pose).refined(pose[None], iterations, truncation_m)[0]
        return found, self.cost(found)

    def _decided(self, pose: FloatArray) -> FramePopulation:
        if not self.differs:
            return self._frame
        searcher = self._searcher
        decided = decide(self._imaged, searcher.cameras, searcher.body, pose)
        return FramePopulation(searcher, decided, self._stamp_ns, pose)
