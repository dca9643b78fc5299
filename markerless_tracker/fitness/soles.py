"""How the feet of a body stand on the floor: height of its ankles, and weight of its soles."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.body import MARKER_NAMES, BodyModel, cone_transforms, markers
from markerless_tracker.geometry import FloatArray

TOE_SHARE = 0.05
"""Weight of the toes, or of an upright foot's whole sole, below the floor. Most bodies' feet are
fixed to their shanks, so that they point into the floor at the end of a step; the height of the
ankles keeps feet on the floor."""
FREE_TOE_SHARE = 0.25
"""The same where the ankles' height is not used."""
_SAME_M = 1e-3


class Ankles(NamedTuple):
    """The ankles of a body with feet.

    Attributes:
        cone: (k,) the cones whose axes end in an ankle, at most one for each foot.
        height_m: (k,) height of each ankle above the sole of a foot that stands flat.
    """

    cone: NDArray[np.int64]
    height_m: FloatArray


def floor_share(body: BodyModel) -> FloatArray:
    """Weight of each end (c, 2) of a cone below the floor: `TOE_SHARE` for toes or sole, else 1."""
    toes = [name.endswith("foot") for name in body.cone_names]
    return np.array([(1.0, TOE_SHARE if toe else 1.0) for toe in toes])


def ankles(body: BodyModel) -> Ankles:
    """The ankles of a body; none if it has no feet."""
    placed, shape, names = cone_transforms(body, body.neutral), body.cone_shape, body.cone_names
    ends = placed[:, :, 3] + placed[:, :, 2] * body.cone_length[:, None]
    at = dict(zip(MARKER_NAMES, markers(body, body.neutral), strict=True))
    cones, heights = [], []
    for foot, marker in (("l_foot", "LAnkle"), ("r_foot", "RAnkle")):
        shanks = np.flatnonzero(np.linalg.norm(ends - at[marker], axis=1) < _SAME_M)
        if foot not in names or shanks.size == 0:
            continue
        own, down = names.index(foot), placed[shanks[0], :, 2]
        x, y, z = down @ placed[own, :, :3]
        start = down @ (placed[own, :, 3] - at[marker])
        along = np.array([0.0, body.cone_length[own]]) * z
        offset = shape[own, :, 2] * x + shape[own, :, 3] * y
        radius = np.hypot(shape[own, :, 0] * x, shape[own, :, 1] * y)
        cones.append(int(shanks[0]))
        heights.append(float((start + along + offset + radius).max()))
    return Ankles(np.array(cones, dtype=np.int64), np.array(heights))
