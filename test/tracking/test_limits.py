"""Joint limits: the published ones only where they exist."""

import numpy as np
import pytest

from markerless_tracker.body import load_body
from markerless_tracker.errors import ConfigError
from markerless_tracker.tracking import TrackerConfig
from markerless_tracker.tracking.limits import (
    ELBOW_RAD_S,
    NECK_RAD_S,
    STRAIGHT_TWIST_RAD_S,
    TWIST_RAD_S,
    joint_limits,
    joint_speeds,
)

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


def test_angles_that_are_seen_badly_change_no_faster_than_a_person_can() -> None:
    body = load_body("person31")
    bent = body.neutral.copy()
    bent[body.index("l_knee")] = -1.0
    speeds = dict(zip(body.parameter_names, joint_speeds(body, bent), strict=True))
    limited = {name: speed for name, speed in speeds.items() if speed < np.inf}
    assert limited == {
        "l_hip_z": TWIST_RAD_S,
        "r_hip_z": STRAIGHT_TWIST_RAD_S,
        "l_shoulder_z": STRAIGHT_TWIST_RAD_S,
        "r_shoulder_z": STRAIGHT_TWIST_RAD_S,
        **dict.fromkeys(("head_x", "head_y", "head_z"), NECK_RAD_S),
        **dict.fromkeys(("l_elbow", "r_elbow"), ELBOW_RAD_S),
    }
    # At 60 frames/s none of them is a step of 12 degrees.
    assert max(limited.values()) < np.deg2rad(12.0) * 60.0
    published = load_body("balan31")
    assert np.isinf(joint_speeds(published, published.neutral)).all()


def test_published_limits_of_a_swing_are_its_anatomical_ones() -> None:
    body = load_body("person31")
    limits = joint_limits(body, TrackerConfig.from_mapping({"limits": "bt_walking"}))
    swings = [i for i, n in enumerate(body.parameter_names) if "hip_" in n or "shoulder_" in n]
    np.testing.assert_array_equal(limits[:, swings], body.limits[:, swings])
    knee = body.index("l_knee")
    np.testing.assert_array_equal(limits[:, knee], body.walking_limits[:, knee])
