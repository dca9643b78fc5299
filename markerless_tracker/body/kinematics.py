"""Forward kinematics of a `BodyModel`: transforms, markers and cones at a pose."""

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.body.model import BodyModel, IntArray
from markerless_tracker.compiled import kernel
from markerless_tracker.geometry import FloatArray


@kernel
def node_transform(n, pose, parent, fixed, kind, sign, parameter, out):  # type: ignore[no-untyped-def]
    """Fill out[n] (3, 4) with the world transform of node n at a pose (p,), its parent's known."""
    above = parent[n]
    if above < 0:
        for i in range(3):
            for j in range(4):
                out[n, i, j] = fixed[n, i, j]
    else:
        for i in range(3):
            a, b, c = out[above, i, 0], out[above, i, 1], out[above, i, 2]
            for j in range(4):
                out[n, i, j] = a * fixed[n, 0, j] + b * fixed[n, 1, j] + c * fixed[n, 2, j]
            out[n, i, 3] += out[above, i, 3]
    move = kind[n]
    if move >= 0:
        value = sign[n] * pose[parameter[n]]
        if move >= 3:
            for i in range(3):
                out[n, i, 3] += value * out[n, i, move - 3]
        else:
            cos, sin = np.cos(value), np.sin(value)
            j, k = (move + 1) % 3, (move + 2) % 3
            for i in range(3):
                a, b = out[n, i, j], out[n, i, k]
                out[n, i, j] = cos * a + sin * b
                out[n, i, k] = cos * b - sin * a


@kernel
def node_transforms(pose, parent, fixed, kind, sign, parameter, out):  # type: ignore[no-untyped-def]
    """Fill out (m, 3, 4) with the world transforms of all nodes at a pose (p,)."""
    for n in range(parent.size):
        node_transform(n, pose, parent, fixed, kind, sign, parameter, out)


def moving_nodes(body: BodyModel, active: IntArray) -> NDArray[np.bool_]:
    """Mask (m,) of the nodes whose transforms depend on any of the active parameters."""
    moves = np.zeros(body.node_parent.size, dtype=np.bool_)
    _find_moving(body.node_parent, body.node_parameter, np.asarray(active, dtype=np.int64), moves)
    return moves


@kernel
def _find_moving(parent, parameter, active, moves):  # type: ignore[no-untyped-def]
    for n in range(parent.size):
        moves[n] = parent[n] >= 0 and moves[parent[n]]
        for i in range(active.size):
            if parameter[n] == active[i]:
                moves[n] = True


def transforms(body: BodyModel, pose: FloatArray) -> FloatArray:
    """World transforms (m, 3, 4) of all nodes at a pose (p,)."""
    out = np.empty((body.node_parent.size, 3, 4))
    node_transforms(
        np.ascontiguousarray(pose, dtype=np.float64),
        body.node_parent,
        body.node_fixed,
        body.node_kind,
        body.node_sign,
        body.node_parameter,
        out,
    )
    return out


def root_transform(body: BodyModel, pose: FloatArray) -> FloatArray:
    """``T_world_root`` (4, 4) of the root frame at a pose (p,)."""
    result = np.eye(4)
    result[:3] = transforms(body, pose)[body.frames[body.root_frame]]
    return result


def markers(body: BodyModel, pose: FloatArray) -> FloatArray:
    """The 15 markers (15, 3) in m, world frame, at a pose (p,)."""
    nodes = transforms(body, pose)[body.marker_node]
    return np.asarray(np.einsum("nij,nj->ni", nodes[:, :, :3], body.marker_offset) + nodes[:, :, 3])


def cone_transforms(body: BodyModel, pose: FloatArray) -> FloatArray:
    """World transforms (c, 3, 4) of the cones' base frames at a pose (p,); the axis is +z."""
    nodes = transforms(body, pose)[body.cone_node]
    out = nodes[:, :, :3] @ body.cone_fixed
    out[:, :, 3] += nodes[:, :, 3]
    return np.asarray(out)


def carried(body: BodyModel, nodes: IntArray) -> FloatArray:
    """(m, k): 1 where node m is node k or a descendant of it, else 0."""
    count = body.node_parent.size
    above = np.zeros((count, count))
    for node, parent in enumerate(body.node_parent.tolist()):
        if parent >= 0:
            above[node] = above[parent]
        above[node, node] = 1.0
    return above[:, nodes]
