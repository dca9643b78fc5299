"""The prior of poses in the refinement: what outlines do not show stays near the usual value."""

import numpy as np
import pytest

from markerless_tracker.body import load_body
from markerless_tracker.tracking.refinement import (
    ELBOW_PRECISION,
    HEAD_ROTATION_SD_RAD,
    STRAIGHT_TWIST_SD_RAD,
    pose_prior,
)


def test_a_straight_limb_keeps_its_usual_rotation_about_itself() -> None:
    body = load_body("person31")
    bent = body.neutral.copy()
    bent[body.index("l_knee")] = -1.0
    prior = pose_prior(body, at=bent)
    more = dict(
        zip(body.parameter_names, prior.precision - pose_prior(body).precision, strict=True)
    )
    raised = {name: value for name, value in more.items() if value > 0.0}
    straight = 1.0 / STRAIGHT_TWIST_SD_RAD**2
    elbow = (ELBOW_PRECISION - 1.0) / body.prior_sd[body.index("l_elbow")] ** 2
    assert raised == {
        "r_hip_z": pytest.approx(straight),
        "l_shoulder_z": pytest.approx(straight),
        "r_shoulder_z": pytest.approx(straight),
        "head_z": pytest.approx(1.0 / HEAD_ROTATION_SD_RAD**2),
        "l_elbow": pytest.approx(elbow),
        "r_elbow": pytest.approx(elbow),
    }
    np.testing.assert_array_equal(prior.mean, body.prior_mean)


@pytest.mark.parametrize("flexion_deg", [0.0, 8.0, 15.0, 29.0])
def test_a_hanging_arm_keeps_near_the_rotation_it_has(flexion_deg) -> None:
    body = load_body("person31")
    at = body.neutral.copy()
    arm, leg = body.index("l_shoulder_z"), body.index("l_hip_z")
    at[[arm, leg]] += 0.4
    at[body.index("l_elbow")] = at[body.index("l_knee")] = -np.deg2rad(flexion_deg)
    mean = pose_prior(body, at=at).mean
    share = (mean[arm] - body.prior_mean[arm]) / 0.4
    # From a fraction to the rest of it: none of a straight arm, most of one bent by 15 degrees.
    expected = {0.0: (0.0, 0.0), 8.0: (0.3, 0.6), 15.0: (0.9, 1.0), 29.0: (0.5, 1.0)}[flexion_deg]
    assert expected[0] <= share <= expected[1]
    assert mean[leg] == body.prior_mean[leg]


def test_published_bodies_keep_their_prior() -> None:
    body = load_body("balan31")
    at = pose_prior(body, at=body.neutral)
    np.testing.assert_array_equal(at.precision, pose_prior(body).precision)
