"""Detects crossed legs or arms, and makes a pose with the two in each other's place.

Crossed legs give nearly the silhouette of uncrossed legs; only the thighs differ. People seldom
cross their legs. Exchanging the joint angles of left and right, as in a mirror, does not uncross
them.
"""

import numpy as np

from markerless_tracker.body import BodyModel, markers
from markerless_tracker.body.model import MARKER_NAMES
from markerless_tracker.geometry import FloatArray
from markerless_tracker.optim import Prior, refine
from markerless_tracker.tracking.candidates.mirror import mirror_of
from markerless_tracker.tracking.confidence import jacobians

PAIRS = ("legs", "arms")
_JOINTS = {"legs": ("Hip", "Knee", "Ankle"), "arms": ("Shoulder", "Elbow", "Wrist")}
_STEPS = 8
_PLACE_M = 0.02
"""Standard deviation of a joint's distance from its goal; the angles have their own prior."""


def is_crossed(body: BodyModel, pose: FloatArray, pair: str) -> bool:
    """Whether both joints of the left limb lie to the right of the right limb's, at a pose (p,).

    Args:
        body: the body.
        pose: (p,).
        pair: "legs" or "arms".
    """
    root, *joints = _JOINTS[pair]
    points = dict(zip(MARKER_NAMES, markers(body, pose), strict=True))
    leftward = points[f"L{root}"] - points[f"R{root}"]
    return all(float((points[f"L{j}"] - points[f"R{j}"]) @ leftward) < 0.0 for j in joints)


def mirrored(body: BodyModel, pose: FloatArray, pair: str, limits: FloatArray) -> FloatArray:
    """A pose (p,) with the joint angles of left and right exchanged, within limits (2, p).

    Args:
        body: the body.
        pose: (p,) the present pose.
        pair: "legs" or "arms".
        limits: (2, p).
    """
    own, out = body.subspaces[pair], pose.copy()
    out[own] = np.clip(mirror_of(body).of(pose)[own], *limits[:, own])
    return out


def in_each_others_place(
    body: BodyModel, pose: FloatArray, pair: str, limits: FloatArray
) -> FloatArray:
    """A pose (p,) with its left limb where the right one was, and its right where the left one was.

    By damped least squares over the pair's parameters from the mirrored pose, as far as the limits
    allow.

    Args:
        body: the body.
        pose: (p,) the present pose.
        pair: "legs" or "arms".
        limits: (2, p).
    """
    _, *joints = _JOINTS[pair]
    moved = [MARKER_NAMES.index(side + joint) for side in "LR" for joint in joints]
    places = [MARKER_NAMES.index(side + joint) for side in "RL" for joint in joints]
    goal_m = markers(body, pose)[places]
    parameters, other = body.subspaces[pair], mirrored(body, pose, pair, limits)

    def equations(values: FloatArray, _: float) -> tuple[FloatArray, FloatArray]:
        other[parameters] = values
        off_m = (markers(body, other)[moved] - goal_m).ravel()
        by_marker = jacobians(body, other)[0].reshape(-1, 3, body.size)
        jacobian = by_marker[moved][:, :, parameters].reshape(off_m.size, -1)
        return jacobian.T @ jacobian / _PLACE_M**2, jacobian.T @ off_m / _PLACE_M**2

    usual = Prior(body.prior_mean[parameters], 1.0 / body.prior_sd[parameters] ** 2)
    other[parameters] = refine(
        equations, other[parameters], priors=(usual,), bounds=limits[:, parameters],
        iterations=_STEPS, truncation=(1.0, 1.0),
    )  # fmt: skip
    return other
