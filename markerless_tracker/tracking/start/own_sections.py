"""Compares the poses of a start, each with sections that are fitted to it.

All poses of a start are found with one body. In loose clothes the arms of a body with a thinner
trunk explain the coat, so that the right place of an arm costs more than the wrong one. With the
sections fitted to each pose it costs less.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from markerless_tracker.body import BodyModel
from markerless_tracker.fitness.shape import fit_shape
from markerless_tracker.geometry import FloatArray
from markerless_tracker.records import Observation
from markerless_tracker.tracking.candidates.own_evidence import OwnEvidence
from markerless_tracker.tracking.candidates.population import FramePopulation, Population
from markerless_tracker.tracking.search import Searcher, SearcherFor

CLOSE, MOST = 0.025, 4
"""Poses that cost at most this much more than the best one, with its body, are compared; the number
of poses at most."""
LEAST_GAIN, LEAST_SHARE = 0.006, 0.75
"""Least gain for which another pose than the best one is taken; also as a share of what it costs
more with the common body. Sections can explain a part of any pose."""
_ROUNDS = 2
"""Fits of the sections, each followed by a refinement of the pose."""
_REFINE = (6, (0.10, 0.05))
"""Iterations of that refinement; truncation (m) in the first and the last one."""


@dataclass(frozen=True, eq=False)
class FittedPose:
    """A pose with sections of its own.

    Attributes:
        searcher: searches with that body.
        pose: (p,).
        cost: `OwnEvidence.cost_with_prior`.
    """

    searcher: Searcher
    pose: FloatArray
    cost: float


def better_with_own_sections(
    population: Population,
    body: BodyModel,
    searcher_for: SearcherFor,
    imaged: Mapping[str, Observation],
    stamp_ns: int,
) -> FittedPose | None:
    """The pose that explains a frame better than the best one, if sections are fitted to both.

    None if there is no such pose.

    Args:
        population: the poses, the best first.
        body: the body that they were found with.
        searcher_for: makes a searcher of a body.
        imaged: the evidence, with the undecided pixels that imaging left.
        stamp_ns: its time.
    """
    close = np.flatnonzero(population.costs <= population.costs[0] + CLOSE)[:MOST]
    if len(close) < 2:
        return None
    fitted = [_fitted(population.poses[i], body, searcher_for, imaged, stamp_ns) for i in close]
    best = int(np.argmin([one.cost for one in fitted]))
    more_cost = float(population.costs[best] - population.costs[0])
    gain = fitted[0].cost - fitted[best].cost
    return fitted[best] if gain >= max(LEAST_GAIN, LEAST_SHARE * more_cost) else None


def _fitted(
    pose: FloatArray,
    body: BodyModel,
    searcher_for: SearcherFor,
    imaged: Mapping[str, Observation],
    stamp_ns: int,
) -> FittedPose:
    def evidence(searcher: Searcher) -> OwnEvidence:
        frame = FramePopulation(searcher, imaged, stamp_ns, pose)
        return OwnEvidence(searcher, imaged, stamp_ns, frame)

    searcher, cost = searcher_for(body), np.inf
    for _ in range(_ROUNDS):
        contours = evidence(searcher).contours(pose)
        shaped = fit_shape(body, [(contours, pose)], hands=searcher.config.fit_lengths)
        searcher = searcher_for(shaped)
        pose, cost = evidence(searcher).refined(pose, *_REFINE)
    return FittedPose(searcher, pose, float(cost))
