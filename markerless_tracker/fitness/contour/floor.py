"""Prior of the floor, the world's plane z = 0: no part of the body lies below it, and a foot stands
on it.

Silhouettes have no lower edge where feet stand in their shadow; without this prior legs would be
fitted into the shadow. Shoes of the floor's colour are missing in silhouettes, and legs would end
above them.
"""

import numpy as np

from markerless_tracker.compiled import inlined, kernel
from markerless_tracker.fitness.contour.chain_kernels import add_wrench
from markerless_tracker.fitness.raster.outline_arrays import LANES
from markerless_tracker.fitness.soles import FREE_TOE_SHARE

SLACK_M = 0.01
"""Soles may lie this far below the floor without a residual: calibration and sections are not
exact."""
BELIEVED_M = 0.1
"""Scale of the robust weight. Larger depths count less and less: the person may stand on another
floor than z = 0, or jump."""
STANDING = 1.0 / 9.0
"""Precision of the lower ankle above the height at which its foot stands flat, relative to that of
parts below the floor: its standard deviation is three times theirs, since heels are lifted."""


@kernel
def robust_weight(value_m):  # type: ignore[no-untyped-def]
    """Robust weight, 0 to 1, of a residual (Geman and McClure)."""
    ratio = value_m / BELIEVED_M
    return 1.0 / (1.0 + ratio * ratio) ** 2


@inlined
def _above(k, body, world):  # type: ignore[no-untyped-def]
    """How much higher an ankle is than in a foot that stands flat, m."""
    return world[11 * LANES + body.ankle_cone[k]] - body.ankle_height[k]


@kernel
def add_floor(body, world, weight, standing, sums):  # type: ignore[no-untyped-def]
    """Add a residual for each end of a cone below the floor, and those of the ankles.

    No ankle is lower than in a foot that stands flat, and the lower one is not much higher. A
    residual lifts the end's centre. Its derivatives are not those of the end's lowest point, which
    would rotate a shank whose foot has no ankle joint: it is upright then where toes are bent.

    Args:
        body: `BodyArrays`.
        world: (18 * LANES,) the cones' ends, filled by `cone_ends`.
        weight: of each residual, before its share and its robust weight.
        standing: whether the ankles' heights are used.
        sums: (m, SUMS) of the parts, added to.
    """
    for c in range(body.cone_node.size):
        for end in range(2):
            at = 9 * end * LANES + c
            first, second = world[at + 5 * LANES], world[at + 8 * LANES]
            low = world[at + 2 * LANES] - np.sqrt(first * first + second * second)
            if low < -SLACK_M:
                value = low + SLACK_M
                share = body.floor_share[c, end]
                if not standing:
                    share = max(share, FREE_TOE_SHARE)
                add_wrench(
                    world[at], world[at + LANES], low, 0.0, 0.0, 1.0,
                    weight * share * robust_weight(value), value, sums, body.cone_node[c],
                )  # fmt: skip
    if not standing:
        return
    lowest = np.inf
    for k in range(body.ankle_cone.size):
        lowest = min(lowest, _above(k, body, world))
    for k in range(body.ankle_cone.size):
        value, share = _above(k, body, world), STANDING
        if value < -SLACK_M:
            value, share = value + SLACK_M, 1.0
        elif not 0.0 < value <= lowest:
            continue
        at = 9 * LANES + body.ankle_cone[k]
        add_wrench(
            world[at], world[at + LANES], world[at + 2 * LANES], 0.0, 0.0, 1.0,
            weight * share * robust_weight(value), value, sums,
            body.cone_node[body.ankle_cone[k]],
        )  # fmt: skip
