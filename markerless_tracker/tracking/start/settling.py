"""The last part of an automatic start: poses with sections of their own, then the body's fit."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from markerless_tracker.camera import CameraModel
from markerless_tracker.records import Observation
from markerless_tracker.tracking.candidates.population import FramePopulation, Population
from markerless_tracker.tracking.evidence.undecided import decide
from markerless_tracker.tracking.person.body_fitting import Unmeasured
from markerless_tracker.tracking.person.start_fit import fitted_to_start
from markerless_tracker.tracking.search import Searcher, SearcherFor
from markerless_tracker.tracking.start.estimate import StartEstimate
from markerless_tracker.tracking.start.own_sections import better_with_own_sections
from markerless_tracker.tracking.start.two_headings import HeadingFit

_SHAPE_FRAMES = 5
"""Most frames that the sections are fitted to."""
_SHAPE_SLACK = 0.01
"""Frames that the sections are fitted to cost at most this much more than the best."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Settling:
    """Completes a start in its last frame, once the heading is known.

    Attributes:
        searcher: with the body found so far.
        searcher_for: makes a searcher of a body.
        cameras: by name.
        person: as in `fitted_to_start`.
        fits: of the heading that was kept, by frame.
        frame: the last frame.
        population: its poses with that heading, the best first.
        observations: the parts of its silhouettes that belong to the person.
        imaged: the same, with the undecided pixels that imaging left.
        stamp_ns: its time.
    """

    searcher: Searcher
    searcher_for: SearcherFor
    cameras: Mapping[str, CameraModel]
    person: Unmeasured | None
    fits: Sequence[HeadingFit]
    frame: FramePopulation
    population: Population
    observations: Mapping[str, Observation]
    imaged: Mapping[str, Observation]
    stamp_ns: int

    def run(self) -> StartEstimate:
        """The start's result, with the fitted body."""
        found = better_with_own_sections(
            self.population, self.searcher.body, self.searcher_for, self.imaged, self.stamp_ns
        )
        if found is None:
            return self._fitted()
        body, pose = found.searcher.body, found.pose
        decided = decide(self.imaged, self.cameras, body, pose)
        return StartEstimate(found.searcher, pose, decided, True)

    def _fitted(self) -> StartEstimate:
        """The best pose, with the body fitted to the frames that it explains best."""
        pose = self.population.poses[0]
        good = min((fit.cost for fit in self.fits), default=0.0) + _SHAPE_SLACK
        used = [(fit.contours, fit.pose) for fit in self.fits if fit.cost <= good][-_SHAPE_FRAMES:]
        used = used or [(self.frame.contours, pose)]
        body, last = fitted_to_start(self.searcher, used, self.person)
        searcher = self.searcher_for(body)
        moved = np.clip(pose + last - used[-1][1], *searcher.limits)
        return StartEstimate(searcher, moved, self.observations, True)
