"""Costs of poses that people hardly take, added to 1 - f_s where poses are compared.

Trousers of the floor's colour leave no silhouette, so that a body with its legs drawn up would fit
best. Where a shadow is taken for a part of the person, a body with its feet in the floor would.
Silhouettes with holes may be explained best by a posture that no person takes; that cost is for the
search of a start alone.
"""

from functools import lru_cache

import numpy as np

from markerless_tracker.body import MARKER_NAMES, BodyModel, markers_of_many
from markerless_tracker.geometry import FloatArray
from markerless_tracker.tracking.candidates.postures import postures

LOWER_M, UPPER_M, IN_FLOOR_M = 0.25, 0.70, 0.05
"""Heights of the lower and of the upper ankle, m, up to which a standing person costs nothing,
since one leg may be raised; and the height below which an ankle is in the floor."""
LOWER_COST, UPPER_COST, IN_FLOOR_COST = 0.3, 0.1, 0.3
"""Cost per metre beyond these heights, in units of f_s."""
MOST_COST = 0.15
"""Largest cost of feet. Where z = 0 is not the room's floor, all poses cost this much and f_s
compares them."""
UNLIKE_COST_PER_M2 = 0.06
"""Cost of a squared distance between a marker and the same one of a known posture. True poses of
people cost 0.006 (median), poses far from the truth 0.05."""
UNLIKE_MOST_M = 0.54
"""A marker farther away counts as at this distance: people move a single limb as they like."""
_ANKLES = [MARKER_NAMES.index("LAnkle"), MARKER_NAMES.index("RAnkle")]
_PELVIS = MARKER_NAMES.index("Pelvis")
_LEFT = [MARKER_NAMES.index("LHip"), MARKER_NAMES.index("LShoulder")]
_RIGHT = [MARKER_NAMES.index("RHip"), MARKER_NAMES.index("RShoulder")]


def off_floor(body: BodyModel, poses: FloatArray) -> FloatArray:
    """Cost (n,) of poses (n, p) whose feet are off the floor, z = 0, in units of f_s."""
    ankles_m = np.sort(markers_of_many(body, poses)[:, _ANKLES, 2], axis=1)
    above_m = np.maximum(ankles_m - (LOWER_M, UPPER_M), 0.0)
    below_m = np.maximum(IN_FLOOR_M - ankles_m, 0.0)
    cost = above_m @ (LOWER_COST, UPPER_COST) + IN_FLOOR_COST * below_m.sum(axis=1)
    return np.asarray(np.minimum(cost, MOST_COST))


def unlike_postures(body: BodyModel, poses: FloatArray) -> FloatArray:
    """Cost (n,) of poses (n, p) by their distance from the nearest of `postures`, in units of f_s.

    The posture has the pose's pelvis and heading. Markers are compared, not angles: many sets of
    angles make the same posture of an arm.
    """
    points = _at_origin(body, poses)
    nearest_m2 = np.full(len(points), np.inf)
    for known in _known(body):
        gaps = points - known
        squared_m2 = np.minimum(np.einsum("nmi,nmi->nm", gaps, gaps), UNLIKE_MOST_M**2)
        np.minimum(nearest_m2, squared_m2.sum(axis=1), out=nearest_m2)
    return np.asarray(UNLIKE_COST_PER_M2 * nearest_m2)


@lru_cache(maxsize=4)
def _known(body: BodyModel) -> FloatArray:
    return _at_origin(body, postures(body))


def _at_origin(body: BodyModel, poses: FloatArray) -> FloatArray:
    """Markers (n, 15, 3) with the pelvis at the origin and the person's left along y."""
    points = markers_of_many(body, poses)
    points = points - points[:, [_PELVIS]]
    left = (points[:, _LEFT] - points[:, _RIGHT]).sum(axis=1)[:, :2]
    left /= np.maximum(np.linalg.norm(left, axis=1, keepdims=True), 1e-9)
    out = points.copy()
    out[..., 0] = left[:, [1]] * points[..., 0] - left[:, [0]] * points[..., 1]
    out[..., 1] = left[:, [0]] * points[..., 0] + left[:, [1]] * points[..., 1]
    return out
