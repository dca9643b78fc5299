"""The joint limits that a configuration asks for."""

import numpy as np

from markerless_tracker.body import BodyModel
from markerless_tracker.errors import ConfigError
from markerless_tracker.geometry import FloatArray
from markerless_tracker.tracking.config import TrackerConfig


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
