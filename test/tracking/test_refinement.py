"""The prior of poses in the refinement: what outlines do not show stays near the usual value."""

import numpy as np
import pytest

from markerless_tracker.body import load_body
from markerless_tracker.tracking.refinement import (
    HEAD_TURN_SD_RAD,
    STRAIGHT_TWIST_SD_RAD,
    pose_prior,
)


def test_a_straight_limb_keeps_its_usual_rotation_about_itself() -> None:
    body = load_body("person31")
    bent = body.neutral.copy()
    bent[body.index("l_knee")] = -1.0
    general, here = pose_prior(body).precision, pose_prior(body, at=bent).precision
    more = dict(zip(body.parameter_names, here - general, strict=True))
    raised = {name: value for name, value in more.items() if value > 0.0}
    straight = 1.0 / STRAIGHT_TWIST_SD_RAD**2
    assert raised == {
        "r_hip_z": pytest.approx(straight),
        "l_shoulder_z": pytest.approx(straight),
        "r_shoulder_z": pytest.approx(straight),
        "head_z": pytest.approx(1.0 / HEAD_TURN_SD_RAD**2),
    }


def test_published_bodies_keep_their_prior() -> None:
    body = load_body("balan31")
    at = pose_prior(body, at=body.neutral)
    np.testing.assert_array_equal(at.precision, pose_prior(body).precision)
