"""The joint limits of a configuration, and whether a pose keeps them."""

import numpy as np

from markerless_tracker.body import BodyModel
from markerless_tracker.body.angles.swing import twists
from markerless_tracker.errors import BodyModelError, ConfigError
from markerless_tracker.geometry import FloatArray
from markerless_tracker.tracking.config import TrackerConfig

TWIST_RAD_S = 10.0
"""Greatest speed of a limb's rotation about itself, which images of a straight limb do not show."""


def joint_speeds(body: BodyModel) -> FloatArray:
    """Greatest speeds (p,) that a search allows: of a limb about itself, else infinite."""
    speeds = np.full(body.size, np.inf)
    speeds[twists(body)] = TWIST_RAD_S
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
    """Raise a BodyModelError unless a start pose is one of the body.

    Args:
        body: the body.
        pose: expected (p,) and finite.
        limits: (2, p) that it must keep, if any.
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
