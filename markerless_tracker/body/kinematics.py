"""Forward kinematics of a `BodyModel`: transforms, markers and cones at a pose."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.body.model import (
    FIRST_TRANSLATION,
    SWING_X,
    SWING_Y,
    BodyModel,
    IntArray,
)
from markerless_tracker.compiled import kernel
from markerless_tracker.geometry import FloatArray

_SMALL_RAD = 1e-4
"""Below it series replace quotients of small numbers."""


@kernel
def swing(a, b, frame):  # type: ignore[no-untyped-def]
    """Rotate a frame (3, 4) by the rotation vector (a, b, 0) of its own axes: Rodrigues' formula.

    The frame's z axis moves along the great circle towards (b, -a, 0) by the vector's length.
    """
    angle = np.sqrt(a * a + b * b)
    s, c = 1.0 - angle * angle / 6.0, 0.5 - angle * angle / 24.0
    cos = np.cos(angle)
    if angle > _SMALL_RAD:
        s, c = np.sin(angle) / angle, (1.0 - cos) / (angle * angle)
    for i in range(3):
        x, y, z = frame[i, 0], frame[i, 1], frame[i, 2]
        across = c * (x * a + y * b)
        frame[i, 0] = cos * x + a * across - s * b * z
        frame[i, 1] = cos * y + b * across + s * a * z
        frame[i, 2] = s * (b * x - a * y) + cos * z


@kernel
def swing_axis(before, after, second, axis):  # type: ignore[no-untyped-def]
    """Fill axis (3,): angular velocity by one parameter of a swing, in the frames' own parent.

    A column of the left Jacobian of the rotation vector, read from the rotation itself: valid up to
    half a turn of the swing.

    Args:
        before, after: (3, 4) frames without and with the swing, of one parent frame.
        second: whether the second parameter moves.
    """
    x = before[0, 2] * after[0, 0] + before[1, 2] * after[1, 0] + before[2, 2] * after[2, 0]
    y = before[0, 2] * after[0, 1] + before[1, 2] * after[1, 1] + before[2, 2] * after[2, 1]
    z = before[0, 2] * after[0, 2] + before[1, 2] * after[1, 2] + before[2, 2] * after[2, 2]
    sin = np.sqrt(x * x + y * y)
    angle = np.arctan2(sin, z)
    ratio, c, d = 1.0, 0.5, 1.0 / 6.0
    if angle > _SMALL_RAD:
        ratio = angle / sin
        c = (1.0 - z) / (angle * angle)
        d = (angle - sin) / (angle * angle * angle)
    a, b = ratio * y, -ratio * x
    if second:
        u, v, w = d * a * b, 1.0 - d * a * a, c * a
    else:
        u, v, w = 1.0 - d * b * b, d * a * b, -c * b
    for i in range(3):
        axis[i] = before[i, 0] * u + before[i, 1] * v + before[i, 2] * w


@kernel
def move_axis(n, kind, sign, nodes, axis):  # type: ignore[no-untyped-def]
    """Fill axis (3,), world frame: velocity of node n, angular or not, by its parameter.

    Args:
        n: a node with a parameter.
        kind, sign: (m,) those of the body.
        nodes: (m, 3, 4) world transforms of the nodes.
    """
    move = kind[n]
    if move == SWING_X:
        swing_axis(nodes[n], nodes[n + 1], False, axis)
    elif move == SWING_Y:
        swing_axis(nodes[n - 1], nodes[n], True, axis)
    else:
        for i in range(3):
            axis[i] = nodes[n, i, move % 3]
    for i in range(3):
        axis[i] *= sign[n]


@kernel
def _move_axes(moved, kind, sign, nodes, axes):  # type: ignore[no-untyped-def]
    for i in range(moved.size):
        move_axis(moved[i], kind, sign, nodes, axes[i])


def move_axes(body: BodyModel, nodes: FloatArray, moved: IntArray) -> FloatArray:
    """Velocities (k, 3) of moved nodes (k,) by their parameters, world frame.

    Angular, about the nodes' origins; of nodes that translate, linear.

    Args:
        body: the body.
        nodes: (m, 3, 4) world transforms.
        moved: indices of nodes that have a parameter.
    """
    axes = np.empty((len(moved), 3))
    _move_axes(moved, body.node_kind, body.node_sign, np.ascontiguousarray(nodes), axes)
    return axes


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
    if move == SWING_Y:
        swing(sign[n - 1] * pose[parameter[n - 1]], sign[n] * pose[parameter[n]], out[n])
    elif move >= 0 and move != SWING_X:
        value = sign[n] * pose[parameter[n]]
        if move >= FIRST_TRANSLATION:
            for i in range(3):
                out[n, i, 3] += value * out[n, i, move - FIRST_TRANSLATION]
        else:
            cos, sin = np.cos(value), np.sin(value)
            j, k = (move + 1) % 3, (move + 2) % 3
            for i in range(3):
                a, b = out[n, i, j], out[n, i, k]
                out[n, i, j] = cos * a + sin * b
                out[n, i, k] = cos * b - sin * a


@kernel
def node_transforms(poses, parent, fixed, kind, sign, parameter, out):  # type: ignore[no-untyped-def]
    """Fill out (n, m, 3, 4) with the world transforms of all nodes at poses (n, p)."""
    for i in range(len(poses)):
        for n in range(parent.size):
            node_transform(n, poses[i], parent, fixed, kind, sign, parameter, out[i])


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
    return np.asarray(transforms_of_many(body, np.asarray(pose)[None])[0])


def transforms_of_many(body: BodyModel, poses: FloatArray) -> FloatArray:
    """World transforms (n, m, 3, 4) of all nodes at poses (n, p)."""
    out = np.empty((len(poses), body.node_parent.size, 3, 4))
    node_transforms(
        np.ascontiguousarray(poses, dtype=np.float64),
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


def markers_of_many(body: BodyModel, poses: FloatArray) -> FloatArray:
    """The markers (n, 15, 3) in m, world frame, at poses (n, p)."""
    nodes = transforms_of_many(body, poses)[:, body.marker_node]
    rotated = np.matmul(nodes[..., :3], body.marker_offset[:, :, None])[..., 0]
    return np.asarray(rotated + nodes[..., 3])


def farthest_moved_m(
    body: BodyModel, pose: FloatArray, poses: FloatArray, active: IntArray
) -> FloatArray:
    """Largest distance (n,) of a marker from its place at a pose (p,), m.

    Args:
        body: the body.
        pose: the pose.
        poses: (n, p), which differ from it in active parameters only.
        active: indices of these.
    """
    nodes, moves = transforms(body, pose), moving_nodes(body, active)
    out = np.empty(len(poses))
    _farthest_moved(
        np.ascontiguousarray(poses, dtype=np.float64), nodes, moves, body.node_parent,
        body.node_fixed, body.node_kind, body.node_sign, body.node_parameter, body.marker_node,
        body.marker_offset, nodes.copy(), out,
    )  # fmt: skip
    return out


@kernel
def _farthest_moved(  # type: ignore[no-untyped-def]
    poses, before, moves, parent, fixed, kind, sign, parameter, marker_node, offset, nodes, out
):
    """Fill out (n,) with the largest distance of a marker between poses (n, p) and another one.

    Args:
        before: (m, 3, 4) transforms of the nodes at the other pose.
        moves: (m,) whether a node's transform differs.
        nodes: (m, 3, 4) a copy of `before`; overwritten where nodes move.
    """
    for i in range(len(poses)):
        for n in range(parent.size):
            if moves[n]:
                node_transform(n, poses[i], parent, fixed, kind, sign, parameter, nodes)
        most = 0.0
        for k in range(marker_node.size):
            n, apart = marker_node[k], 0.0
            if moves[n]:
                for r in range(3):
                    gap = nodes[n, r, 3] - before[n, r, 3]
                    for c in range(3):
                        gap += (nodes[n, r, c] - before[n, r, c]) * offset[k, c]
                    apart += gap * gap
            most = max(most, apart)
        out[i] = np.sqrt(most)


def cone_transforms(body: BodyModel, pose: FloatArray) -> FloatArray:
    """World transforms (c, 3, 4) of the cones' base frames at a pose (p,); the axis is +z."""
    nodes = transforms(body, pose)[body.cone_node]
    out = nodes[:, :, :3] @ body.cone_fixed
    out[:, :, 3] += nodes[:, :, 3]
    return np.asarray(out)


def carried(body: BodyModel, nodes: IntArray) -> FloatArray:
    """(m, k): 1 where node m is node k or a descendant of it, else 0."""
    return np.asarray(_descent(body)[:, nodes])


@lru_cache(maxsize=64)
def _descent(body: BodyModel) -> FloatArray:
    """As `carried`, of all nodes (m, m); read-only."""
    count = body.node_parent.size
    above = np.zeros((count, count))
    for node, parent in enumerate(body.node_parent.tolist()):
        if parent >= 0:
            above[node] = above[parent]
        above[node, node] = 1.0
    above.flags.writeable = False
    return above
