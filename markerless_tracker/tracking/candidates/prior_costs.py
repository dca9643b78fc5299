"""Costs of limbs by how usual they are, added to 1 - f_s where poses are compared.

In loose clothes silhouettes hardly show an arm beside the trunk. A pose with that arm through the
trunk, or bent behind the neck where it explains hair, then has about the same f_s as the true pose,
or a higher one. The prior decides between them.
"""

from functools import lru_cache

import numpy as np

from markerless_tracker.body import BodyModel
from markerless_tracker.geometry import FloatArray
from markerless_tracker.tracking.candidates.postures import postures

COST = 0.001
"""Cost of a unit of the negative log of a limb's prior density, in units of f_s. The limbs of
people who walk are at 0 to 3 units, an arm through the trunk or behind the neck at 5 to 25."""
POSTURE = 3.0
"""A limb that is as in a known posture is at this many units: people seldom squat or cross their
arms."""
MOST = 10.0
"""No limb is at more units: people move a single limb as they like."""


def prior_costs(body: BodyModel, poses: FloatArray) -> FloatArray:
    """Cost (n,) of the limbs of poses (n, p), in units of f_s.

    The prior density of a limb's angles is a normal one about the body's usual pose, and smaller
    ones of the same width about the limb in each of `postures`. The largest counts.
    """
    costs = np.zeros(len(poses))
    for name in body.limbs:
        limb = body.subspaces[name]
        means, units = _means(body, name)
        apart = (poses[:, limb] / body.prior_sd[limb])[:, None] - means
        energy = units + 0.5 * np.einsum("nkd,nkd->nk", apart, apart)
        costs += COST * np.minimum(energy.min(axis=1), MOST)
    return costs


@lru_cache(maxsize=16)
def _means(body: BodyModel, limb: str) -> tuple[FloatArray, FloatArray]:
    """Means (k, d) of a limb's angles, in standard deviations; units (k,) of a limb there."""
    angles = body.subspaces[limb]
    # In many postures a limb is the same. (`np.unique` takes longer than all the rest.)
    known = np.array(list(dict.fromkeys(map(tuple, postures(body)[:, angles]))))
    means = np.concatenate([body.prior_mean[None, angles], known]) / body.prior_sd[angles]
    return means, np.append(0.0, np.full(len(known), POSTURE))
