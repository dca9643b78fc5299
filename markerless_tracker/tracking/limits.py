"""Joint limits of a configuration, greatest speeds of joints, and the check of a start pose."""

import numpy as np

from markerless_tracker.body import BodyModel
from markerless_tracker.body.angles.swing import straightness, twists
from markerless_tracker.errors import BodyModelError, ConfigError
from markerless_tracker.geometry import FloatArray
from markerless_tracker.tracking.config import TrackerConfig

TWIST_RAD_S = 8.0
"""Greatest speed of the rotation about its own axis of a limb with a bent knee or elbow."""
STRAIGHT_TWIST_RAD_S = 3.0
"""The same for a straight limb, whose rotation images do not show."""
NECK_RAD_S = 4.0
"""Greatest speed of each rotation of the head relative to the trunk, as in a quick glance aside."""
ELBOW_RAD_S = 12.0
"""Greatest speed of an elbow: reached in reaching and catching, exceeded in throws only."""
LIMB_RAD_S = 12.0
"""Greatest speed of the joints of a limb that is found elsewhere, but near its former place."""
_NECK = ("head_x", "head_y", "head_z")
_ELBOWS = ("l_elbow", "r_elbow")


def joint_speeds(body: BodyModel, pose: FloatArray) -> FloatArray:
    """Greatest speeds (p,) that a search allows from a pose (p,), rad/s; infinite if unlimited.

    Limited are the rotations of limbs about their own axes, of the neck and of the elbows. Bodies
    without swing and twist joints, like the published ones, have no such limits.
    """
    speeds = np.full(body.size, np.inf)
    own = twists(body)
    if not own.size:
        return speeds
    straight = straightness(body, pose)
    speeds[own] = TWIST_RAD_S + straight * (STRAIGHT_TWIST_RAD_S - TWIST_RAD_S)
    for names, speed in ((_NECK, NECK_RAD_S), (_ELBOWS, ELBOW_RAD_S)):
        speeds[[body.index(name) for name in names if name in body.parameter_names]] = speed
    return speeds


def joint_limits(body: BodyModel, config: TrackerConfig) -> FloatArray:
    """Lower and upper limits (2, p), rad and m.

    Joints that the published body does not have keep their anatomical limits under `bt_walking`.

    Raises:
        ConfigError: `bt_walking` for a body that states none of these limits.
    """
    if config.limits != "bt_walking":
        return body.limits
    stated = np.isfinite(body.walking_limits)
    if not stated.any():
        raise ConfigError(
            f"limits: got 'bt_walking', but body {body.name} states no such limits; "
            "expected 'anatomical', or a body with the published 31 parameters such as balan31"
        )
    return np.where(stated, body.walking_limits, body.limits)


def check_pose(body: BodyModel, pose: FloatArray, limits: FloatArray | None) -> None:
    """Raise a BodyModelError if a start pose is not valid for the body.

    Args:
        body: the body.
        pose: expected (p,) and finite.
        limits: (2, p) within which it must lie, if any.
    """
    if pose.shape != (body.size,) or not np.isfinite(pose).all():
        raise BodyModelError(
            f"start pose has shape {pose.shape}, body {body.name} expects "
            f"{body.size} finite numbers"
        )
    if limits is None:
        return
    for name, value, low, high in zip(body.parameter_names, pose, *limits, strict=True):
        if not low <= value <= high:
            raise BodyModelError(
                f"start pose: {name} is {value:.4g}, its limits are {low:.4g} to {high:.4g}"
            )
