"""Normal equations along the kinematic chain, from sums over each part of the body.

The derivative of a residual by a joint is the product of the joint's twist and the residual's
wrench (g, X x g), with the gradient g at the point X. So JᵀWJ needs no row per residual: outer
products of wrenches are summed per part, then up the tree. Derivation: docs/normal-equations.md.
"""

from markerless_tracker.body.kinematics import move_axis
from markerless_tracker.body.model import FIRST_TRANSLATION, SWING_X
from markerless_tracker.compiled import kernel

SUMS = 27
"""Sums per part: upper triangle of Σ W f fᵀ (21 numbers), then Σ W r f (6), f the wrench."""


@kernel
def add_wrench(x, y, z, gx, gy, gz, weight, value, sums, node):  # type: ignore[no-untyped-def]
    """Add a residual's wrench to row `node` of sums (m, SUMS).

    Args:
        x, y, z: the point; gx, gy, gz: the residual's gradient with respect to it.
        weight, value: the residual's.
    """
    wrench = (gx, gy, gz, y * gz - z * gy, z * gx - x * gz, x * gy - y * gx)
    k = 0
    for i in range(6):
        scaled = weight * wrench[i]
        for j in range(i, 6):
            sums[node, k] += scaled * wrench[j]
            k += 1
    for i in range(6):
        sums[node, 21 + i] += weight * value * wrench[i]


@kernel
def fill_twist(node, body, nodes, twist):  # type: ignore[no-untyped-def]
    """Fill twist (6,) of a node's joint."""
    kind = body.kind[node]
    move_axis(node, body.kind, body.sign, nodes, twist[3:])
    wx, wy, wz = twist[3], twist[4], twist[5]
    if FIRST_TRANSLATION <= kind < SWING_X:
        twist[0], twist[1], twist[2] = wx, wy, wz
        twist[3], twist[4], twist[5] = 0.0, 0.0, 0.0
        return
    x, y, z = nodes[node, 0, 3], nodes[node, 1, 3], nodes[node, 2, 3]
    twist[0], twist[1], twist[2] = y * wz - z * wy, z * wx - x * wz, x * wy - y * wx


@kernel
def sum_chain(body, nodes, sums, twists, hessian, gradient):  # type: ignore[no-untyped-def]
    """Fill hessian (p, p) and gradient (p,) from the parts' sums (m, SUMS).

    The sums become those of the subtrees, and twists (m + 1, 6) those of the joints; its last row
    is scratch. Parents must come before their children.
    """
    hessian[:] = 0.0
    gradient[:] = 0.0
    count = body.parent.size
    for node in range(count):
        if body.kind[node] >= 0:
            fill_twist(node, body, nodes, twists[node])
    force = twists[count]
    for node in range(count - 1, -1, -1):
        above = body.parent[node]
        if above >= 0:
            for k in range(SUMS):
                sums[above, k] += sums[node, k]
        if body.kind[node] < 0:
            continue
        twist = twists[node]
        force[:] = 0.0
        k = 0
        for i in range(6):
            force[i] += sums[node, k] * twist[i]
            k += 1
            for j in range(i + 1, 6):
                force[i] += sums[node, k] * twist[j]
                force[j] += sums[node, k] * twist[i]
                k += 1
        p = body.parameter[node]
        for i in range(6):
            gradient[p] += twist[i] * sums[node, 21 + i]
            hessian[p, p] += twist[i] * force[i]
        while above >= 0:
            if body.kind[above] >= 0:
                other = twists[above]
                entry = 0.0
                for i in range(6):
                    entry += other[i] * force[i]
                q = body.parameter[above]
                hessian[p, q] += entry
                hessian[q, p] += entry
            above = body.parent[above]
