"""Prior of the floor: no part of the body lies below the world's plane z = 0.

Silhouettes have no lower edge where feet stand in their shadow; without this prior legs would be
fitted into the shadow.
"""

import numpy as np

from markerless_tracker.compiled import kernel
from markerless_tracker.fitness.contour.chain_kernels import add_wrench
from markerless_tracker.fitness.raster.outline_arrays import LANES

SLACK_M = 0.01
"""Soles may lie this far below the floor without a residual: calibration and sections are not
exact."""
BELIEVED_M = 0.1
"""Scale of the robust weight. Larger depths count less and less: the person may stand on another
floor than z = 0."""


@kernel
def robust_weight(value_m):  # type: ignore[no-untyped-def]
    """Robust weight, 0 to 1, of a residual (Geman and McClure)."""
    ratio = value_m / BELIEVED_M
    return 1.0 / (1.0 + ratio * ratio) ** 2


@kernel
def add_floor(body, world, weight, sums):  # type: ignore[no-untyped-def]
    """Add a residual for each end of a cone below the floor; toes count less.

    Args:
        body: `BodyArrays`.
        world: (18 * LANES,) the cones' ends, filled by `cone_ends`.
        weight: of each residual, before its robust weight.
        sums: (m, SUMS) of the parts, added to.
    """
    for c in range(body.cone_node.size):
        for end in range(2):
            at = 9 * end * LANES + c
            first, second = world[at + 5 * LANES], world[at + 8 * LANES]
            low = world[at + 2 * LANES] - np.sqrt(first * first + second * second)
            if low < -SLACK_M:
                value = low + SLACK_M
                robust = body.floor_share[c, end] * robust_weight(value)
                add_wrench(
                    world[at], world[at + LANES], low, 0.0, 0.0, 1.0, weight * robust,
                    value, sums, body.cone_node[c],
                )  # fmt: skip
