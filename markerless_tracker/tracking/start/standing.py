"""A person who is found stands, sits or kneels on the floor, z = 0: not above it, nor in it.

Trousers of the floor's colour leave no silhouette: a body with its legs drawn up would fit best.
Where a shadow is taken for a part of the person, a body that reaches into the floor would.
"""

import numpy as np

from markerless_tracker.body import MARKER_NAMES, BodyModel
from markerless_tracker.geometry import FloatArray
from markerless_tracker.tracking.start.many_poses import markers_of_many

LOWER_M, UPPER_M, IN_FLOOR_M = 0.25, 0.70, 0.05
"""Heights of the lower and of the upper ankle, m, up to which the person may stand: the upper leg
may be raised. Below the last one a foot is in the floor."""
LOWER_COST, UPPER_COST, IN_FLOOR_COST = 0.3, 0.1, 0.3
"""Cost of each metre above or below, in units of f_s."""
MOST_COST = 0.15
"""All poses cost this much where the calibration's floor is not the room's: they still compare."""
_ANKLES = [MARKER_NAMES.index("LAnkle"), MARKER_NAMES.index("RAnkle")]


def off_floor(body: BodyModel, poses: FloatArray) -> FloatArray:
    """Cost (n,) of poses (n, p) whose feet are off the floor, in units of f_s."""
    ankles_m = np.sort(markers_of_many(body, poses)[:, _ANKLES, 2], axis=1)
    above_m = np.maximum(ankles_m - (LOWER_M, UPPER_M), 0.0)
    below_m = np.maximum(IN_FLOOR_M - ankles_m, 0.0)
    cost = above_m @ (LOWER_COST, UPPER_COST) + IN_FLOOR_COST * below_m.sum(axis=1)
    return np.asarray(np.minimum(cost, MOST_COST))
