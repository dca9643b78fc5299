"""Inter-penetration of cones: the default rule and the published one.

Both follow Balan, Sigal and Black (2005): the first cone of a pair is filled with equally spaced
spheres. Published rule: the second cone is, too, and a pose is infeasible if any two spheres
overlap. It ignores the flat section of the torso and rejects true poses with hanging arms. Default
rule: the second cone keeps its elliptic section, and both cones are reduced by a margin.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.body.kinematics import moving_nodes, node_transform, transforms
from markerless_tracker.body.model import BodyModel, IntArray
from markerless_tracker.compiled import kernel
from markerless_tracker.errors import ConfigError
from markerless_tracker.geometry import FloatArray
from markerless_tracker.records import locked

RULES = ("elliptic", "published", "none")
"""Values of the setting `collision`."""
MARGIN_M = 0.030
"""Reduction of both cones by the default rule."""
_MOST_SPHERES = 20
_NONE = np.empty(0, dtype=np.int64)


@dataclass(frozen=True, eq=False)
class Spheres:
    """Spheres that fill the cones of a body.

    Attributes:
        first: (c + 1,) cone i has the spheres first[i] .. first[i + 1] - 1.
        centre: (s, 3) centres in the cone's base frame, m.
        radius: (s,) radii, m.
    """

    first: IntArray
    centre: FloatArray
    radius: FloatArray


def fill_with_spheres(body: BodyModel) -> Spheres:
    """Fill every cone with n + 1 spheres, n = round(length / greatest radius / 2), 1 <= n <= 20.

    The radius is interpolated between the greater radii of both ends and divided by
    sqrt(1 + (difference / length)²), so that the sphere touches the cone's side.
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


class Constraints(NamedTuple):
    """Joint limits and pairs of cones that d active parameters move, as kernels read them.

    Attributes:
        active: (d,) indices of the parameters.
        pose: (p,) the other parameters' values; the active ones change.
        limits: (2, p); NaN if no pose is feasible.
        moving: nodes that the active parameters move, parents first.
        parent, fixed, kind, sign, parameter, cone_node, cone_fixed, cone_length, cone_shape: of the
            body.
        pairs: (k, 2) cones that must not inter-penetrate.
        first, centre, radius: `Spheres`.
        published: whether both cones of a pair are filled with spheres.
        margin_m: reduction of both cones otherwise.
        nodes: (m, 3, 4) transforms; those of moving nodes change.
    """

    active: IntArray
    pose: FloatArray
    limits: FloatArray
    moving: IntArray
    parent: IntArray
    fixed: FloatArray
    kind: IntArray
    sign: FloatArray
    parameter: IntArray
    cone_node: IntArray
    cone_fixed: FloatArray
    cone_length: FloatArray
    cone_shape: FloatArray
    pairs: IntArray
    first: IntArray
    centre: FloatArray
    radius: FloatArray
    published: bool
    margin_m: float
    nodes: FloatArray


class Feasibility:
    """Tests batches of poses against joint limits and a collision rule (compiled).

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
        self.limits = np.array(limits, dtype=np.float64)
        self.rule = rule
        pairs = body.collisions if rule != "none" else np.empty((0, 2), dtype=np.int64)
        self._pairs = np.array(pairs)
        self._known: dict[bytes, tuple[IntArray, NDArray[np.bool_], IntArray]] = {}

    def __call__(self, poses: FloatArray) -> NDArray[np.bool_]:
        """Mask (n,) of the poses (n, p) within the limits and without inter-penetration."""
        return self.around(np.arange(self.body.size), self.body.neutral)(poses)

    def around(
        self, active: IntArray, centre: FloatArray, *, forgive: bool = False
    ) -> Callable[[FloatArray], NDArray[np.bool_]]:
        """The same test for points (n, d): values of d parameters, the others fixed at a centre.

        Pairs of cones that the active parameters do not move are tested once, at the centre.

        Args:
            active: (d,) indices of the parameters that vary.
            centre: (p,) values of the other parameters.
            forgive: ignore pairs of cones that inter-penetrate at the centre. For centres found in
                images, where an inter-penetration means that the model's sections are too wide.
        """
        constraints = self.constraints(active, centre, forgive=forgive)
        return lambda points: satisfied(points, constraints)

    def constraints(
        self, active: IntArray, centre: FloatArray, *, forgive: bool = False
    ) -> Constraints:
        """The constraints that `around` tests, for compiled searches; same arguments."""
        # Copies: kernels are compiled once more for arrays that are read-only.
        active = np.array(active, dtype=np.int64)
        moving, moved, rest = self._parts(active)
        body, spheres, pairs = self.body, self._spheres, self._pairs
        every = Constraints(
            active, np.array(centre, dtype=np.float64), self.limits, moving, body.node_parent,
            body.node_fixed, body.node_kind, body.node_sign, body.node_parameter, body.cone_node,
            body.cone_fixed, body.cone_length, body.cone_shape, pairs, spheres.first,
            spheres.centre, spheres.radius, self.rule == "published", MARGIN_M,
            transforms(body, centre),
        )  # fmt: skip
        if forgive:
            still = every._replace(active=_NONE, moving=_NONE)
            kept = _apart(still, centre[None, :0])
            pairs, moved = pairs[kept], moved[kept]
        others = every._replace(active=rest, moving=_NONE, pairs=pairs[~moved])
        if not satisfied(centre[None, rest], others)[0]:
            return every._replace(limits=np.full(self.limits.shape, np.nan))
        return every._replace(pairs=pairs[moved])

    @cached_property
    def _spheres(self) -> Spheres:
        return fill_with_spheres(self.body)

    def _parts(self, active: IntArray) -> tuple[IntArray, NDArray[np.bool_], IntArray]:
        """Nodes that parameters move, pairs of cones that they do, and the other parameters."""
        key = active.tobytes()
        if key not in self._known:
            moves = moving_nodes(self.body, active)
            either = np.asarray(moves[self.body.cone_node[self._pairs]].any(axis=1))
            rest = np.setdiff1d(np.arange(self.body.size), active)
            self._known[key] = np.flatnonzero(moves), either, rest
        return self._known[key]


def satisfied(points: FloatArray, constraints: Constraints) -> NDArray[np.bool_]:
    """Mask (n,) of the points (n, d) that satisfy constraints."""
    out = np.empty(len(points), dtype=np.bool_)
    are_feasible(np.array(points, dtype=np.float64), constraints, out)
    return out


def _apart(constraints: Constraints, point: FloatArray) -> NDArray[np.bool_]:
    """Mask (k,) of the pairs that satisfy the rule at a point (1, d)."""
    pairs = constraints.pairs
    if satisfied(point, constraints)[0]:
        return np.ones(len(pairs), dtype=np.bool_)
    ones = (constraints._replace(pairs=pairs[k : k + 1]) for k in range(len(pairs)))
    return np.array([satisfied(point, one)[0] for one in ones])


@kernel
def _to_world(frame, x, y, z):  # type: ignore[no-untyped-def]
    """World coordinates of a point of a frame (3, 4)."""
    return (
        frame[0, 0] * x + frame[0, 1] * y + frame[0, 2] * z + frame[0, 3],
        frame[1, 0] * x + frame[1, 1] * y + frame[1, 2] * z + frame[1, 3],
        frame[2, 0] * x + frame[2, 1] * y + frame[2, 2] * z + frame[2, 3],
    )


@kernel
def _from_world(frame, x, y, z):  # type: ignore[no-untyped-def]
    """Coordinates of a world point in a frame (3, 4)."""
    x, y, z = x - frame[0, 3], y - frame[1, 3], z - frame[2, 3]
    return (
        frame[0, 0] * x + frame[1, 0] * y + frame[2, 0] * z,
        frame[0, 1] * x + frame[1, 1] * y + frame[2, 1] * z,
        frame[0, 2] * x + frame[1, 2] * y + frame[2, 2] * z,
    )


@kernel
def _inside_cone(x, y, z, length, shape, grow):  # type: ignore[no-untyped-def]
    """Whether a point in a cone's base frame lies inside the cone enlarged by `grow`."""
    if z < -grow or z > length + grow:
        return False
    t = min(max(z / length, 0.0), 1.0)
    rx = (1.0 - t) * shape[0, 0] + t * shape[1, 0] + grow
    ry = (1.0 - t) * shape[0, 1] + t * shape[1, 1] + grow
    if rx <= 0.0 or ry <= 0.0:
        return False
    x = (x - (1.0 - t) * shape[0, 2] - t * shape[1, 2]) / rx
    y = (y - (1.0 - t) * shape[0, 3] - t * shape[1, 3]) / ry
    return x * x + y * y < 1.0


@kernel
def are_feasible(points, constraints, out):  # type: ignore[no-untyped-def]
    """Fill out (n,): whether points (n, d) satisfy `Constraints`; its pose and nodes change."""
    c = constraints
    active, pose, limits, pairs, nodes = c.active, c.pose, c.limits, c.pairs, c.nodes
    cone_node, cone_fixed = c.cone_node, c.cone_fixed
    cone_length, cone_shape = c.cone_length, c.cone_shape
    first, centre, radius = c.first, c.centre, c.radius
    for n in range(points.shape[0]):
        good = True
        for i in range(active.size):
            p = active[i]
            pose[p] = points[n, i]
            if not (limits[0, p] <= pose[p] <= limits[1, p]):
                good = False
        if good and pairs.shape[0] > 0:
            for i in range(c.moving.size):
                node_transform(
                    c.moving[i], pose, c.parent, c.fixed, c.kind, c.sign, c.parameter, nodes
                )
            for k in range(pairs.shape[0]):
                p, q = pairs[k, 0], pairs[k, 1]
                for i in range(first[p], first[p + 1]):
                    x, y, z = _to_world(cone_fixed[p], centre[i, 0], centre[i, 1], centre[i, 2])
                    x, y, z = _to_world(nodes[cone_node[p]], x, y, z)
                    if not c.published:
                        x, y, z = _from_world(nodes[cone_node[q]], x, y, z)
                        x, y, z = _from_world(cone_fixed[q], x, y, z)
                        grow = radius[i] - 2.0 * c.margin_m
                        if _inside_cone(x, y, z, cone_length[q], cone_shape[q], grow):
                            good = False
                            break
                        continue
                    for j in range(first[q], first[q + 1]):
                        u, v, w = _to_world(cone_fixed[q], centre[j, 0], centre[j, 1], centre[j, 2])
                        u, v, w = _to_world(nodes[cone_node[q]], u, v, w)
                        gap = (x - u) ** 2 + (y - v) ** 2 + (z - w) ** 2
                        if gap < (radius[i] + radius[j]) ** 2:
                            good = False
                            break
                    if not good:
                        break
                if not good:
                    break
        out[n] = good
