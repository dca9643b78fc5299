"""Other places of a limb that explain a frame nearly as well as the estimate.

The covariance of a refinement describes one optimum. A search of a limb finds other optima; if one
costs nearly as much, the limb may as well be there.
"""

from dataclasses import dataclass

import numpy as np

from markerless_tracker.body import BodyModel, markers
from markerless_tracker.geometry import FloatArray

COST_SCALE = 0.0035
"""Difference of costs, in units of f_s, by which a place is e times less probable: of the limbs
whose best other place costs as much as their own or less, a third are wrong, of those whose other
place costs 0.006 to 0.01 more, one of twenty to thirty."""
APART_M = 0.10
"""Least distance of a marker; a nearer place is the same optimum."""


@dataclass(frozen=True, eq=False)
class Rival:
    """Another pose of a limb.

    Attributes:
        probability: that the limb has this pose instead of the estimate's, 0 to 0.5.
        moved: (p,) difference of its parameters from the estimate's.
        moved_m: (15, 3) difference of its markers, m.
    """

    probability: float
    moved: FloatArray
    moved_m: FloatArray


def rival_of(
    body: BodyModel, pose: FloatArray, other: FloatArray, more_cost: float
) -> Rival | None:
    """The rival that another pose is to the estimate; None if it is the same place.

    Args:
        body: the body.
        pose: (p,) the estimate.
        other: (p,) the other pose.
        more_cost: by how much it costs more than the estimate, in units of f_s. If it costs less,
            but was not taken, both are as probable.
    """
    moved_m = markers(body, other) - markers(body, pose)
    if float(np.linalg.norm(moved_m, axis=1).max()) < APART_M:
        return None
    probability = 1.0 / (1.0 + np.exp(max(more_cost, 0.0) / COST_SCALE))
    return Rival(float(probability), other - pose, moved_m)
