"""Costs of limbs by how usual they are, added to 1 - f_s where poses are compared.

In loose clothes silhouettes hardly show an arm beside the trunk. A pose with that arm through the
trunk, or bent behind the neck where it explains hair, then has about the same f_s as the true pose,
or a higher one. The prior decides between them.
"""

from functools import lru_cache

import numpy as np

from markerless_tracker.body import BodyModel
from markerless_tracker.body.model import IntArray
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
    for limbs in _pairs(body):
        alone, together = np.zeros(len(poses)), np.full((len(poses), 1), POSTURE)
        for limb, means in limbs:
            apart = (poses[:, limb] / body.prior_sd[limb])[:, None] - means
            energy = 0.5 * np.einsum("nkd,nkd->nk", apart, apart)
            usual, known = energy[:, 0], energy[:, 1:]
            alone += np.minimum(np.minimum(usual, POSTURE + known.min(axis=1)), MOST)
            together = together + known
        costs += COST * np.minimum(alone, together.min(axis=1))
    return costs


@lru_cache(maxsize=16)
def _pairs(body: BodyModel) -> list[list[tuple[IntArray, FloatArray]]]:
    """Both arms and both legs: each limb's angles (d,), and their means (1 + k, d) in standard
    deviations, usual and as in the known postures. Postures in which both limbs are the same are
    one.
    """
    pairs = []
    for kind in dict.fromkeys(name[1:] for name in body.limbs):
        limbs = [body.subspaces[name] for name in body.limbs if name[1:] == kind]
        both = np.concatenate(limbs)
        # (`np.unique` takes longer than all the rest.)
        known = np.array(list(dict.fromkeys(map(tuple, postures(body)[:, both]))))
        means = np.concatenate([body.prior_mean[None, both], known]) / body.prior_sd[both]
        ends = np.cumsum([limb.size for limb in limbs])[:-1]
        pairs.append(list(zip(limbs, np.split(means, ends, axis=1), strict=True)))
    return pairs
