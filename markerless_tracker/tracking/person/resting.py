"""The person's resting posture of trunk, shoulders and head, from a measured start pose.

The positions of shoulders, neck and top of the head relative to the trunk depend on the person and
on the measuring system's definition of joint centres. At rest the angles of clavicles, thorax and
head differ more between people, and between systems, than they change in motion. A measured start
pose shows the resting posture and the posture of that moment together. Differences between left
and right, and deviations larger than those among people, are attributed to that moment.
"""

from dataclasses import replace

import numpy as np

from markerless_tracker.body import BodyModel
from markerless_tracker.geometry import FloatArray

MIDDLE = ("thorax_y", "head_y")
"""Forward bending of trunk and head, which is symmetric."""
PAIRED = {"clavicle_x": -1.0, "clavicle_y": 1.0}
"""Parameters of left and right, and the factor between them in a symmetric posture."""
MOST_SD = 2.0
"""Largest shift of the resting posture, in standard deviations of the prior of poses."""
NARROWER = 0.5
"""Factor of the prior's standard deviations of trunk and shoulders about the person's own posture,
since one person's motion is smaller than the differences among people and definitions."""
_NARROWED = (
    "thorax_x", "thorax_y", "thorax_z",
    "l_clavicle_x", "l_clavicle_y", "r_clavicle_x", "r_clavicle_y",
)  # fmt: skip


def at_rest(body: BodyModel, start: FloatArray) -> BodyModel:
    """The body with its prior of poses centred at the person's resting posture.

    Args:
        body: the body, with measured lengths.
        start: (p,) measured pose.
    """
    index = {name: i for i, name in enumerate(body.parameter_names)}
    mean = body.prior_mean.copy()
    off = start - body.prior_mean
    for name in MIDDLE:
        if name in index:
            _shift(mean, body, index[name], off[index[name]])
    for name, factor in PAIRED.items():
        if f"l_{name}" in index and f"r_{name}" in index:
            left, right = index[f"l_{name}"], index[f"r_{name}"]
            both = 0.5 * (off[left] + factor * off[right])
            _shift(mean, body, left, both)
            _shift(mean, body, right, factor * both)
    sd = body.prior_sd.copy()
    sd[[index[name] for name in _NARROWED if name in index]] *= NARROWER
    return replace(body, prior_mean=mean, prior_sd=sd)


def _shift(mean: FloatArray, body: BodyModel, at: int, by: float) -> None:
    most = MOST_SD * float(body.prior_sd[at])
    mean[at] += float(np.clip(by, -most, most))
