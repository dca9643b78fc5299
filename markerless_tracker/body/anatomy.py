"""Postures in anatomical angles: flexion, bending and abduction are positive on both sides.

The parameters of the shipped bodies keep the published signs, which differ from joint to joint.
"""

from collections.abc import Mapping

import numpy as np

from markerless_tracker.body.model import MARKER_NAMES, BodyModel
from markerless_tracker.geometry import FloatArray

_NEGATIVE = ("r_hip_x", "l_knee", "r_knee", "l_shoulder_y", "l_elbow", "r_elbow")
"""Parameters whose sign is opposite to the anatomical one."""
_SIDES = ("Hip", "Shoulder")


def posture(body: BodyModel, angles_rad: Mapping[str, float]) -> FloatArray:
    """The neutral pose (p,) with anatomical angles added; joints the body lacks are ignored."""
    pose = body.neutral.copy()
    for name, angle in angles_rad.items():
        if name in body.parameter_names:
            pose[body.index(name)] += -angle if name in _NEGATIVE else angle
    return pose


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
