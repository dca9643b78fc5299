"""Inter-penetration of cones: the default rule and the published one.

Both follow Balan, Sigal and Black (2005): the first cone of a pair is filled with equally spaced
spheres. Published: so is the second, and the body is impossible if any two spheres overlap; the
flat section of the torso is ignored, which refuses true poses with hanging arms. Default: the
second cone keeps its elliptic section, and both are shrunk by a margin.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from markerless_tracker.body.kinematics import moving_nodes, node_transform, transforms
from markerless_tracker.body.model import BodyModel, IntArray
from markerless_tracker.errors import ConfigError
from markerless_tracker.geometry import FloatArray
from markerless_tracker.records import locked

RULES = ("elliptic", "published", "none")
MARGIN_M = 0.030
_MOST_SPHERES = 20


@dataclass(frozen=True, eq=False)
class Spheres:
    """Spheres that fill the cones taking part in a collision rule.

    Attributes:
        first: (c + 1,) the spheres of cone i are first[i] .. first[i + 1].
        centre: (s, 3) in the cone's base frame, m.
        radius: (s,) m.
    """

    first: IntArray
    centre: FloatArray
    radius: FloatArray


def fill_with_spheres(body: BodyModel) -> Spheres:
    """Fill every cone with n + 1 spheres, n = round(length / greatest radius / 2), 1 <= n <= 20.

    The radius is interpolated between the ends' greater radii and divided by
    sqrt(1 + (difference / length)²), which makes the sphere touch the cone's side.
    """
    first, centres, radii = [0], [], []
    for length, shape in zip(body.cone_length, body.cone_shape, strict=True):
        ends = np.max(shape[:, :2], axis=1)
        count = int(np.clip(round(length / ends.max() / 2.0), 1, _MOST_SPHERES))
        t = np.linspace(0.0, 1.0, count + 1)
        offset = (1.0 - t)[:, None] * shape[0, 2:] + t[:, None] * shape[1, 2:]
        centres.append(np.column_stack([offset, t * length]))
        slant = np.sqrt(1.0 + ((ends[1] - ends[0]) / length) ** 2)
        radii.append(((1.0 - t) * ends[0] + t * ends[1]) / slant)
        first.append(first[-1] + count + 1)
    return Spheres(
        locked(np.array(first), np.int64),
        locked(np.concatenate(centres), float),
        locked(np.concatenate(radii), float),
    )


class Feasibility:
    """Tests poses against limits and a collision rule, in one compiled pass over a batch.

    Args:
        body: the body.
        limits: (2, p) lower and upper limits.
        rule: 'elliptic' (default), 'published' or 'none'.

    Raises:
        ConfigError: the rule is unknown.
    """

    def __init__(self, body: BodyModel, limits: FloatArray, rule: str) -> None:
        if rule not in RULES:
            raise ConfigError(f"collision is {rule!r}, expected one of {', '.join(RULES)}")
        self.body = body
        self.limits = locked(limits, float)
        self.rule = rule
        self._spheres = fill_with_spheres(body)
        self._pairs = body.collisions if rule != "none" else np.empty((0, 2), dtype=np.int64)

    def __call__(self, poses: FloatArray) -> NDArray[np.bool_]:
        """Mask (n,) of the poses (n, p) that keep the limits and do not inter-penetrate."""
        return self.around(np.arange(self.body.size), self.body.neutral)(poses)

    def around(
        self, active: IntArray, centre: FloatArray
    ) -> Callable[[FloatArray], NDArray[np.bool_]]:
        """The same test of points (n, d): values of some parameters, the others are at a centre.

        What the active parameters (d,) do not move is tested once, at the centre (p,).
        """
        body, spheres, pairs = self.body, self._spheres, self._pairs
        moves = moving_nodes(body, active)
        either = moves[body.cone_node[pairs]].any(axis=1)
        nodes = transforms(body, centre)
        pose = np.array(centre, dtype=np.float64)

        def test(
            points: FloatArray, active: IntArray, moving: IntArray, pairs: IntArray
        ) -> NDArray[np.bool_]:
            out = np.empty(len(points), dtype=np.bool_)
            _feasible(
                np.ascontiguousarray(points, dtype=np.float64), active, pose, self.limits, moving,
                body.node_parent, body.node_fixed, body.node_kind, body.node_sign,
                body.node_parameter, body.cone_node, body.cone_fixed, body.cone_length,
                body.cone_shape, pairs, spheres.first, spheres.centre, spheres.radius,
                self.rule == "published", MARGIN_M, nodes, out,
            )  # fmt: skip
            return out

        rest = np.setdiff1d(np.arange(body.size), active)
        if not test(centre[None, rest], rest, np.empty(0, dtype=np.int64), pairs[~either])[0]:
            return lambda points: np.zeros(len(points), dtype=np.bool_)
        moving, touching = np.flatnonzero(moves), np.ascontiguousarray(pairs[either])
        return lambda points: test(points, active, moving, touching)


@njit(cache=True, nogil=True)  # type: ignore[misc]
def _cone_point(node, fixed, point, out):  # type: ignore[no-untyped-def]
    """World position (3,) of a point of a cone's base frame."""
    x = fixed[0, 0] * point[0] + fixed[0, 1] * point[1] + fixed[0, 2] * point[2] + fixed[0, 3]
    y = fixed[1, 0] * point[0] + fixed[1, 1] * point[1] + fixed[1, 2] * point[2] + fixed[1, 3]
    z = fixed[2, 0] * point[0] + fixed[2, 1] * point[1] + fixed[2, 2] * point[2] + fixed[2, 3]
    for i in range(3):
        out[i] = node[i, 0] * x + node[i, 1] * y + node[i, 2] * z + node[i, 3]


@njit(cache=True, nogil=True)  # type: ignore[misc]
def _inside_cone(node, fixed, length, shape, point, grow):  # type: ignore[no-untyped-def]
    """Whether a world point lies inside a cone whose surface is moved out by `grow`."""
    local = np.empty(3)
    moved = np.empty(3)
    for i in range(3):
        moved[i] = point[i] - node[i, 3]
    for i in range(3):
        local[i] = node[0, i] * moved[0] + node[1, i] * moved[1] + node[2, i] * moved[2]
    for i in range(3):
        moved[i] = local[i] - fixed[i, 3]
    for i in range(3):
        local[i] = fixed[0, i] * moved[0] + fixed[1, i] * moved[1] + fixed[2, i] * moved[2]
    if local[2] < -grow or local[2] > length + grow:
        return False
    t = min(max(local[2] / length, 0.0), 1.0)
    rx = (1.0 - t) * shape[0, 0] + t * shape[1, 0] + grow
    ry = (1.0 - t) * shape[0, 1] + t * shape[1, 1] + grow
    if rx <= 0.0 or ry <= 0.0:
        return False
    x = (local[0] - (1.0 - t) * shape[0, 2] - t * shape[1, 2]) / rx
    y = (local[1] - (1.0 - t) * shape[0, 3] - t * shape[1, 3]) / ry
    return x * x + y * y < 1.0


@njit(cache=True, nogil=True)  # type: ignore[misc]
def _feasible(  # type: ignore[no-untyped-def]
    points, active, pose, limits, moving, parent, fixed, kind, sign, parameter,
    cone_node, cone_fixed, cone_length, cone_shape, pairs, first, centre, radius,
    published, margin, nodes, out,
):  # fmt: skip
    a = np.empty(3)
    b = np.empty(3)
    for n in range(points.shape[0]):
        good = True
        for i in range(active.size):
            p = active[i]
            pose[p] = points[n, i]
            if not (limits[0, p] <= pose[p] <= limits[1, p]):
                good = False
        if good and pairs.shape[0] > 0:
            for i in range(moving.size):
                node_transform(moving[i], pose, parent, fixed, kind, sign, parameter, nodes)
            for k in range(pairs.shape[0]):
                p, q = pairs[k, 0], pairs[k, 1]
                for i in range(first[p], first[p + 1]):
                    _cone_point(nodes[cone_node[p]], cone_fixed[p], centre[i], a)
                    if not published:
                        if _inside_cone(
                            nodes[cone_node[q]], cone_fixed[q], cone_length[q], cone_shape[q],
                            a, radius[i] - 2.0 * margin,
                        ):  # fmt: skip
                            good = False
                            break
                        continue
                    for j in range(first[q], first[q + 1]):
                        _cone_point(nodes[cone_node[q]], cone_fixed[q], centre[j], b)
                        gap = 0.0
                        for m in range(3):
                            gap += (a[m] - b[m]) ** 2
                        if gap < (radius[i] + radius[j]) ** 2:
                            good = False
                            break
                    if not good:
                        break
                if not good:
                    break
        out[n] = good
