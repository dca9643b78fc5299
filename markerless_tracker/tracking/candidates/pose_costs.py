"""Costs of limbs where people hardly have them, added to 1 - f_s where poses are compared.

In loose clothes the silhouettes hardly show an arm beside the trunk. A pose with an arm through the
trunk, or bent behind the neck, then explains hair or a fold of the clothes, and has a higher f_s
than the true one.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.body import MARKER_NAMES, BodyModel
from markerless_tracker.body.parts import cones_of
from markerless_tracker.compiled import kernel
from markerless_tracker.geometry import FloatArray
from markerless_tracker.tracking.candidates.many_poses import markers_at, transforms_of_many

USUAL = 2.0
"""A limb costs nothing up to this negative log of its prior density, less that of the mean. Limbs
of people who walk have at most 3, those of wrong poses 5 to 25."""
LIMB_COST = 0.003
"""Cost of each unit beyond it, in units of f_s."""
MOST = 10.0
"""Largest number of units of a limb: people move a single limb as they like."""
CORE = 0.6
"""Part of the trunk's radii within which an arm costs something. Sections that were fitted to loose
clothes hold a part of a hanging arm."""
TRUNK_COST = 0.2
"""Cost of both arms along the trunk's axis, in units of f_s; less the farther from it."""
_UPPER, _FORE = (0.5, 0.75, 1.0), (0.25, 0.5, 0.75, 1.0)
"""Points of the upper arm and of the forearm that are tested, as fractions of their lengths."""
_JOINTS = ("Shoulder", "Elbow", "Wrist")
_ARMS = [MARKER_NAMES.index(side + joint) for side in "LR" for joint in _JOINTS]


def pose_costs(body: BodyModel, poses: FloatArray) -> FloatArray:
    """Cost (n,) of poses (n, p), in units of f_s: `unusual_limbs` and `arms_in_trunk`."""
    return unusual_limbs(body, poses) + arms_in_trunk(body, poses)


def unusual_limbs(body: BodyModel, poses: FloatArray) -> FloatArray:
    """Cost (n,) of poses (n, p) with limbs that are improbable by the body's prior."""
    energy = 0.5 * ((poses - body.prior_mean) / body.prior_sd) ** 2
    cost = np.zeros(len(poses))
    for name in body.limbs:
        beyond = energy[:, body.subspaces[name]].sum(axis=1) - USUAL
        cost += LIMB_COST * np.clip(beyond, 0.0, MOST)
    return cost


def arms_in_trunk(body: BodyModel, poses: FloatArray) -> FloatArray:
    """Cost (n,) of poses (n, p) whose arms are inside the trunk."""
    nodes = transforms_of_many(body, poses)
    shares = np.empty(len(nodes))
    _share_inside(
        nodes, markers_at(body, nodes)[:, _ARMS], _trunk(body), body.cone_node, body.cone_fixed,
        body.cone_length, body.cone_shape, np.array(_UPPER), np.array(_FORE), shares,
    )  # fmt: skip
    return TRUNK_COST * shares


@lru_cache(maxsize=8)
def _trunk(body: BodyModel) -> NDArray[np.int64]:
    """The cones that belong neither to a limb nor to the head."""
    trunk = np.ones(len(body.cone_node), dtype=np.bool_)
    for name in (*body.limbs, "head"):
        if name in body.subspaces:
            trunk &= ~cones_of(body, name)
    return np.flatnonzero(trunk)


@kernel
def _share_inside(  # type: ignore[no-untyped-def]
    nodes, joints, trunk, cone_node, cone_fixed, cone_length, cone_shape, upper, fore, out
):
    """Fill out (n,): mean over an arm's points of 1 - r / `CORE`, r their part of a section's
    radii.

    Args:
        nodes: (n, m, 3, 4) of each pose.
        joints: (n, 6, 3) shoulder, elbow and wrist of both arms.
        trunk: the trunk's cones.
        cone_node, cone_fixed, cone_length, cone_shape: of the body.
        upper, fore: points of the upper arm and of the forearm, as fractions of their lengths.
        out: (n,), written.
    """
    for n in range(joints.shape[0]):
        total = 0.0
        for first in range(5):
            # From shoulder to elbow, from elbow to wrist; not from a wrist to the other shoulder.
            if first == 2:
                continue
            along = upper if first % 3 == 0 else fore
            for k in range(along.size):
                t = along[k]
                x = (1.0 - t) * joints[n, first, 0] + t * joints[n, first + 1, 0]
                y = (1.0 - t) * joints[n, first, 1] + t * joints[n, first + 1, 1]
                z = (1.0 - t) * joints[n, first, 2] + t * joints[n, first + 1, 2]
                nearest = CORE
                for i in range(trunk.size):
                    c = trunk[i]
                    part = _part_of_radii(
                        x, y, z, nodes[n, cone_node[c]], cone_fixed[c], cone_length[c],
                        cone_shape[c],
                    )  # fmt: skip
                    nearest = min(nearest, part)
                total += 1.0 - nearest / CORE
        out[n] = total / (2.0 * (upper.size + fore.size))


@kernel
def _part_of_radii(x, y, z, node, fixed, length, shape):  # type: ignore[no-untyped-def]
    """Distance of a world point from a cone's axis, relative to its section; 1 beyond its ends."""
    u, v, w = _local(x, y, z, node)
    u, v, w = _local(u, v, w, fixed)
    t = w / length
    if t < 0.0 or t > 1.0:
        return 1.0
    u = u - (1.0 - t) * shape[0, 2] - t * shape[1, 2]
    v = v - (1.0 - t) * shape[0, 3] - t * shape[1, 3]
    u /= (1.0 - t) * shape[0, 0] + t * shape[1, 0]
    v /= (1.0 - t) * shape[0, 1] + t * shape[1, 1]
    return np.sqrt(u * u + v * v)


@kernel
def _local(x, y, z, frame):  # type: ignore[no-untyped-def]
    """Coordinates in a frame (3, 4) of a point outside of it."""
    x, y, z = x - frame[0, 3], y - frame[1, 3], z - frame[2, 3]
    return (
        frame[0, 0] * x + frame[1, 0] * y + frame[2, 0] * z,
        frame[0, 1] * x + frame[1, 1] * y + frame[2, 1] * z,
        frame[0, 2] * x + frame[1, 2] * y + frame[2, 2] * z,
    )
