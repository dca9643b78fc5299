"""Ball joints as a swing and a twist: three parameters without a singularity where people are.

The swing is a rotation vector (a, b) perpendicular to the limb, measured from a reference direction
in the middle of the joint's range; the twist is a rotation about the limb after it. The only
singular direction is opposite to the reference: into the trunk.
"""

import numpy as np

from markerless_tracker.body.kinematics import transforms
from markerless_tracker.body.model import SWING_X, SWING_Y, BodyModel, IntArray
from markerless_tracker.geometry import FloatArray

BENT_RAD = float(np.deg2rad(30.0))
"""Least flexion at which a knee or elbow shows a limb's rotation about its own axis."""
_Z = 2
_HINGES = {"hip": "knee", "shoulder": "elbow"}


def swing_joints(body: BodyModel) -> tuple[str, ...]:
    """Names of the frames that end in a swing and a twist about z."""
    found = []
    for name, node in body.frames.items():
        above = int(body.node_parent[node])
        if body.node_kind[node] == _Z and above >= 0 and body.node_kind[above] == SWING_Y:
            found.append(name)
    return tuple(found)


def twists(body: BodyModel) -> IntArray:
    """Indices of the parameters that rotate a limb about its own axis."""
    nodes = [body.frames[name] for name in swing_joints(body)]
    return np.asarray(body.node_parameter[nodes], dtype=np.int64)


def straightness(body: BodyModel, pose: FloatArray, bent_rad: float = BENT_RAD) -> FloatArray:
    """How straight the limbs of `twists` (k,) are at a pose (p,): 1 with a straight knee or elbow.

    0 for a flexion of at least `bent_rad`, and for a limb without such a joint. Images of a
    straight limb do not show its rotation about its own axis; a bent limb shows it by the sine of
    the flexion.
    """
    found = []
    for joint in swing_joints(body):
        side, _, name = joint.partition("_")
        hinge = f"{side}_{_HINGES.get(name, '')}"
        if hinge not in body.parameter_names:
            found.append(0.0)
            continue
        flexion = min(abs(float(pose[body.index(hinge)])), bent_rad)
        found.append(1.0 - float(np.sin(flexion) / np.sin(bent_rad)) ** 2)
    return np.array(found)


def split(rotation: FloatArray) -> tuple[float, float, float]:
    """Swing (a, b) and twist c, rad, of a rotation (3, 3): exp(a, b, 0), then c about z.

    The twist is within half a turn. At half a turn of swing, which no joint reaches, any split is
    as good as another.
    """
    sin = float(np.hypot(rotation[0, 2], rotation[1, 2]))
    angle = float(np.arctan2(sin, rotation[2, 2]))
    ratio = angle / sin if sin > 1e-12 else 1.0
    a, b = -ratio * float(rotation[1, 2]), ratio * float(rotation[0, 2])
    # The twist's sine and cosine, from the sum and difference of the matrix's upper left corner.
    turn = float(np.arctan2(rotation[1, 0] - rotation[0, 1], rotation[0, 0] + rotation[1, 1]))
    return a, b, turn


def set_rotation(body: BodyModel, pose: FloatArray, joint: str, rotation: FloatArray) -> None:
    """Set a joint's three parameters in a pose (p,).

    Args:
        body: the body.
        pose: changed.
        joint: one of `swing_joints`.
        rotation: (3, 3) from the joint's neutral frame to its new one, in axes of the neutral one.
    """
    twist = body.frames[joint]
    second = int(body.node_parent[twist])
    first = int(body.node_parent[second])
    if body.node_kind[first] != SWING_X:
        raise AssertionError(f"body {body.name}: node {first} is no first node of a swing")
    rest = transforms(body, body.neutral)
    before, after = rest[first, :, :3], rest[twist, :, :3]
    for node, value in zip((first, second, twist), split(before.T @ after @ rotation), strict=True):
        pose[body.node_parameter[node]] = value / body.node_sign[node]
