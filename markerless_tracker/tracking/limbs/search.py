"""Search of one limb alone over its whole range, while the rest of the body stays."""

from collections.abc import Callable

import numpy as np

from markerless_tracker.body.model import IntArray
from markerless_tracker.geometry import FloatArray
from markerless_tracker.tracking.search import LIMB_M
from markerless_tracker.tracking.start.population import FramePopulation
from markerless_tracker.tracking.start.recombination import Recombiner

DRAWS = 120
"""First draws of a limb: half from the pose prior, half uniform."""
AIMED, AIMED_OF = 60, 1000
"""Where silhouette is unexplained: further draws that reach there, the best of so many."""
LAYERS = (0.4, 0.2)
"""Then the best are varied, twice, by these fractions of the prior's standard deviations."""
HOPELESS = 0.03
"""A limb whose cost exceeds the largest useful cost by more than this is not refined."""
_PARENTS, _CHILDREN = 6, 10
_REFINE = (3, (LIMB_M, 0.035))
"""Iterations of the refinement of the best, and truncation (m) of the first and the last."""


def other_limb(
    frame: FramePopulation,
    recombiner: Recombiner,
    pose: FloatArray,
    limb: IntArray,
    rng: np.random.Generator,
    aim: Callable[[FloatArray, int], FloatArray] | None = None,
    most_cost: float = np.inf,
) -> tuple[FloatArray, float]:
    """The best pose (p,) that is found with a limb elsewhere, and its cost 1 - f_s.

    Draws are sparse for a limb of six joints, so the best are varied twice, as in an annealed
    filter. One contour refinement, of the whole body, then refines the best of all.

    Args:
        frame: the evidence.
        recombiner: draws limbs of the body.
        pose: (p,) where the rest of the body is.
        limb: the limb's parameters.
        rng: draws.
        most_cost: largest useful cost; the result matters only below it.
        aim: keeps those poses, of many and at most so many, that reach where the limb may be; first
            draws are chosen by it, too.
    """
    half = DRAWS // 2
    poses = np.concatenate(
        [
            recombiner.with_prior_limb(pose, limb, half, rng),
            recombiner.with_limb(pose, limb, DRAWS - half, rng),
        ]
    )
    if aim is not None:
        many = [
            recombiner.with_prior_limb(pose, limb, AIMED_OF // 2, rng),
            recombiner.with_limb(pose, limb, AIMED_OF // 2, rng),
        ]
        poses = np.concatenate([poses, aim(np.concatenate(many), AIMED)])
    costs_of = frame.limb_costs(pose, limb)
    costs = costs_of(poses[:, limb])
    for layer, fraction in enumerate(LAYERS, 1):
        best = np.argsort(costs, kind="stable")[:_PARENTS]
        near = recombiner.with_limb_near(
            np.repeat(poses[best], _CHILDREN, axis=0), limb, fraction, rng
        )
        # Of the last layer only the best counts, of the others the parents.
        cutoff = costs[best[0 if layer == len(LAYERS) else -1]]
        poses = np.concatenate([poses[best], near])
        more = costs_of(near[:, limb], np.full(len(near), cutoff))
        costs = np.concatenate([costs[best], more])
    if costs.min() > most_cost + HOPELESS:
        return pose, float(costs.min())
    refined = frame.refined(poses[[int(costs.argmin())]], *_REFINE)
    return refined[0], float(frame.costs(refined)[0])
