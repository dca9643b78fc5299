"""Cost of feet off the floor, z = 0: a person stands, sits or kneels on the floor.

Trousers of the floor's colour leave no silhouette, so that a body with its legs drawn up would fit
best. Where a shadow is taken for a part of the person, a body with its feet in the floor would.
"""

import numpy as np

from markerless_tracker.body import MARKER_NAMES, BodyModel
from markerless_tracker.geometry import FloatArray
from markerless_tracker.tracking.start.many_poses import markers_of_many

LOWER_M, UPPER_M, IN_FLOOR_M = 0.25, 0.70, 0.05
"""Heights of the lower and of the upper ankle, m, up to which a standing person costs nothing,
since one leg may be raised; and the height below which an ankle is in the floor."""
LOWER_COST, UPPER_COST, IN_FLOOR_COST = 0.3, 0.1, 0.3
"""Cost per metre beyond these heights, in units of f_s."""
MOST_COST = 0.15
"""Largest cost. Where z = 0 is not the room's floor, all poses cost this much and f_s compares
them."""
_ANKLES = [MARKER_NAMES.index("LAnkle"), MARKER_NAMES.index("RAnkle")]


def off_floor(body: BodyModel, poses: FloatArray) -> FloatArray:
    """Cost (n,) of poses (n, p) whose feet are off the floor, in units of f_s."""
    ankles_m = np.sort(markers_of_many(body, poses)[:, _ANKLES, 2], axis=1)
    above_m = np.maximum(ankles_m - (LOWER_M, UPPER_M), 0.0)
    below_m = np.maximum(IN_FLOOR_M - ankles_m, 0.0)
    cost = above_m @ (LOWER_COST, UPPER_COST) + IN_FLOOR_COST * below_m.sum(axis=1)
    return np.asarray(np.minimum(cost, MOST_COST))
