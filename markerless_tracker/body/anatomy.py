"""Postures in anatomical angles: flexion, bending and abduction are positive on both sides.

The parameters of the shipped bodies keep the published signs, which differ from joint to joint, or
are those of a swing and a twist.
"""

from collections.abc import Mapping

import numpy as np

from markerless_tracker.body.angles.swing import set_rotation, swing_joints
from markerless_tracker.body.kinematics import transforms
from markerless_tracker.body.model import MARKER_NAMES, BodyModel
from markerless_tracker.geometry import FloatArray, rotation_from_euler

_NEGATIVE = ("r_hip_x", "l_knee", "r_knee", "l_shoulder_y", "l_elbow", "r_elbow")
"""Parameters of the published 31 whose sign is opposite to the anatomical one."""
_BENDING = ("hip_x", "knee", "shoulder_y", "elbow")
"""Joints that bend further in the anatomically positive direction."""
_SIDES = ("Hip", "Shoulder")
_SHOULDER_TILT_RAD = float(np.deg2rad(12.0))
"""Published abduction of a hanging arm from the clavicle: flexion comes before it."""


def published_sign(parameter: str) -> float:
    """Sign of one of the published 31 parameters whose anatomical angle is positive: 1 or -1."""
    return -1.0 if parameter in _NEGATIVE else 1.0


def _sign(body: BodyModel, parameter: str) -> float:
    """Sign of a parameter whose anatomical angle is positive: that of its wider limit."""
    if parameter[2:] not in _BENDING:
        return 1.0
    at = body.index(parameter)
    low, high = body.limits[:, at] - body.neutral[at]
    return -1.0 if -low > high else 1.0


def posture(body: BodyModel, angles_rad: Mapping[str, float]) -> FloatArray:
    """The neutral pose (p,) with anatomical angles added; joints the body lacks are ignored.

    Those of a hip or shoulder are the angles of the published chain, flexion (`_y`), then abduction
    (`_x`), then rotation about the limb (`_z`), also for bodies with a swing and a twist there.
    """
    pose = body.neutral.copy()
    swings = swing_joints(body)
    for name, angle in angles_rad.items():
        if name in body.parameter_names and name[:-2] not in swings:
            pose[body.index(name)] += _sign(body, name) * angle
    for joint in swings:
        x, y, z = (float(angles_rad.get(f"{joint}_{axis}", 0.0)) for axis in "xyz")
        if (x, y, z) != (0.0, 0.0, 0.0):
            set_rotation(body, pose, joint, _from_rest(body, joint, x, y, z))
    return pose


def _from_rest(body: BodyModel, joint: str, x: float, y: float, z: float) -> FloatArray:
    """Rotation (3, 3) of a limb from neutral, in axes of the joint's neutral frame."""
    out = 1.0 if joint.startswith("l_") else -1.0
    tilt, twist = (_SHOULDER_TILT_RAD, -z) if joint.endswith("shoulder") else (0.0, z)
    # In axes x forward, y left, z up.
    turned = rotation_from_euler("xyxz", [-out * tilt, -y, out * (tilt + x), twist])
    axes = np.round(transforms(body, body.neutral)[body.frames[joint], :, :3])
    return np.asarray(axes.T @ turned @ axes)


def heading(markers_m: FloatArray) -> float:
    """Heading of a body: angle about the world's vertical from its x axis, rad.

    Args:
        markers_m: (15, 3) in the order of `MARKER_NAMES`.
    """
    row = MARKER_NAMES.index
    left = sum(markers_m[row("L" + part)] - markers_m[row("R" + part)] for part in _SIDES)
    return float(np.arctan2(-left[0], left[1]))


def heading_difference(angle_rad: float, other_rad: float) -> float:
    """Absolute angle between two headings, rad, 0 to pi."""
    return float(abs((angle_rad - other_rad + np.pi) % (2.0 * np.pi) - np.pi))
