"""Costs of limbs by how usual they are, added to 1 - f_s where poses are compared.

In loose clothes silhouettes hardly show an arm beside the trunk. A pose with that arm through the
trunk, or bent behind the neck where it explains hair, then has about the same f_s as the true pose,
or a higher one. The prior decides between them.
"""

from functools import lru_cache

import numpy as np

from markerless_tracker.body import BodyModel
from markerless_tracker.body.model import IntArray
from markerless_tracker.compiled import kernel
from markerless_tracker.geometry import FloatArray
from markerless_tracker.tracking.candidates.postures import postures

COST = 0.001
"""Cost of a unit of the negative log of a limb's prior density, in units of f_s. The limbs of
people who walk are at 0 to 3 units, an arm through the trunk or behind the neck at 5 to 25."""
POSTURE = 3.0
"""A limb that is as in a known posture is at this many units, and so are both arms, or both legs,
that are as in the same one: people seldom squat or cross their arms, but if they do, with both."""
MOST = 10.0
"""No limb is at more units: people move a single limb as they like."""


def prior_costs(body: BodyModel, poses: FloatArray) -> FloatArray:
    """Cost (n,) of the limbs of poses (n, p), in units of f_s.

    The prior density of a limb's angles is a normal one about the body's usual pose, and smaller
    ones of the same width about the limb in each of `postures`. That of both arms, or both legs, is
    the product of their densities, or a smaller one about both in a posture. The largest counts.
    """
    costs = np.zeros(len(poses))
    for limbs, means, sd in _pairs(body):
        _add_costs(poses, limbs, means, sd, costs)
    return costs


@kernel
def _add_costs(poses, limbs, means, sd, costs):  # type: ignore[no-untyped-def]
    """Add the costs of a pair of limbs to costs (n,); other arguments as of `_pairs`."""
    for n in range(costs.size):
        pose, first, second, both = poses[n], np.inf, np.inf, np.inf
        for k in range(1, means.shape[0]):
            left = _energy(pose, limbs[0], means[k, 0], sd[0])
            right = _energy(pose, limbs[1], means[k, 1], sd[1])
            first, second, both = min(first, left), min(second, right), min(both, left + right)
        alone = min(_energy(pose, limbs[0], means[0, 0], sd[0]), POSTURE + first, MOST)
        alone += min(_energy(pose, limbs[1], means[0, 1], sd[1]), POSTURE + second, MOST)
        costs[n] += COST * min(alone, POSTURE + both)


@kernel
def _energy(pose, limb, mean, sd):  # type: ignore[no-untyped-def]
    """Negative log of a normal density of a limb (d,) about a mean (d,), without its constant."""
    energy = 0.0
    for j in range(limb.size):
        energy += 0.5 * ((pose[limb[j]] - mean[j]) / sd[j]) ** 2
    return energy


@lru_cache(maxsize=16)
def _pairs(body: BodyModel) -> list[tuple[IntArray, FloatArray, FloatArray]]:
    """Both arms and both legs: the limbs' parameters (2, d), their means (1 + k, 2, d), usual and
    as in the known postures, and standard deviations (2, d). Postures in which both limbs are the
    same are one.
    """
    pairs = []
    for kind in dict.fromkeys(name[1:] for name in body.limbs):
        limbs = np.stack([body.subspaces[name] for name in body.limbs if name[1:] == kind])
        # (`np.unique` takes longer than all the rest.)
        known = list(dict.fromkeys(map(tuple, postures(body)[:, limbs.ravel()])))
        means = np.array([body.prior_mean[limbs.ravel()], *known]).reshape(-1, *limbs.shape)
        pairs.append((limbs, means, body.prior_sd[limbs]))
    return pairs
