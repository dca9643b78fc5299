"""Which cones hang from a subspace's joints; found once per body."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.body.kinematics import carried
from markerless_tracker.body.model import BodyModel


@lru_cache(maxsize=64)
def cones_of(body: BodyModel, subspace: str) -> NDArray[np.bool_]:
    """Mask (c,) of the cones that any parameter of a subspace moves; read-only."""
    nodes = np.flatnonzero(np.isin(body.node_parameter, body.subspaces[subspace]))
    mask = np.asarray(carried(body, nodes)[body.cone_node].any(axis=1))
    mask.flags.writeable = False
    return mask
