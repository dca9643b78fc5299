"""Crossed legs or arms that an automatic start found, compared with uncrossed ones.

Crossed legs explain the silhouettes nearly as well (`candidates.crossed`), and they have decided
the undecided pixels with which the population is compared.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.tracking.candidates.crossed import PAIRS, is_crossed
from markerless_tracker.tracking.candidates.own_evidence import OwnEvidence
from markerless_tracker.tracking.candidates.population import FramePopulation, Population

_REFINE = (4, (0.12, 0.035))
"""Iterations of the refinement of both poses; truncation (m) in the first and the last one."""


def uncrossed(
    own: OwnEvidence,
    frame: FramePopulation,
    population: Population,
    leading_of: Callable[[Population], Population],
) -> Population:
    """A population without crossed legs or arms if uncrossed ones explain the frame as well.

    The best pose that leads is compared with the best one of which the pair is not crossed, each
    refined in its own evidence. Else the population stays as it is; poses with the opposite heading
    stay in any case.

    Args:
        own: the evidence for poses that decide it themselves.
        frame: the evidence decided so far.
        population: the poses.
        leading_of: selects the poses with the heading that leads.
    """
    for pair in PAIRS:
        leading = leading_of(population)
        crossed = _are_crossed(own, leading, pair)
        if pair not in own.body.subspaces or not crossed[0] or crossed.all():
            continue
        best = own.refined(leading.poses[0], *_REFINE)
        other = own.refined(leading.poses[int(crossed.argmin())], *_REFINE)
        if not is_crossed(own.body, other, pair) and own.gain(best, other) >= 0.0:
            heading_rad = float(leading.headings[0])
            same, away = (population.facing(h) for h in (heading_rad, heading_rad + np.pi))
            kept = (same.poses[~_are_crossed(own, same, pair)], other[None], away.poses)
            population = frame.selected(np.concatenate(kept))
    return population


def _are_crossed(own: OwnEvidence, population: Population, pair: str) -> NDArray[np.bool_]:
    """Of which poses of a population a pair is crossed, (n,)."""
    return np.array([is_crossed(own.body, pose, pair) for pose in population.poses], np.bool_)
