"""Joint limits: the published ones only where they exist."""

import numpy as np
import pytest

from markerless_tracker.body import load_body
from markerless_tracker.errors import ConfigError
from markerless_tracker.tracking import TrackerConfig
from markerless_tracker.tracking.limits import joint_limits

WALKING = TrackerConfig.from_mapping({"limits": "bt_walking"})


@pytest.mark.parametrize("name", ["humaneva34", "person34"])
def test_bodies_without_published_limits_say_so(name) -> None:
    body = load_body(name, 1.75)
    with pytest.raises(ConfigError, match=f"limits: got 'bt_walking', but body {name} states no"):
        joint_limits(body, WALKING)
    assert joint_limits(body, TrackerConfig()) is body.limits


def test_joints_that_the_published_body_lacks_keep_their_anatomical_limits() -> None:
    body = load_body("person35", 1.75)
    found = joint_limits(body, WALKING)
    wrist, knee = body.index("l_wrist"), body.index("l_knee")
    np.testing.assert_array_equal(found[:, wrist], body.limits[:, wrist])
    np.testing.assert_allclose(found[:, knee], [-1.4434, 0.4701])
    assert np.isinf(found[:, body.index("pelvis_tx")]).all()
