"""person32: person31 with a trunk that bends to the side."""

import numpy as np
import pytest

from markerless_tracker.body import (
    MARKER_NAMES,
    Feasibility,
    cone_transforms,
    load_body,
    markers,
    pose_from_markers,
)
from markerless_tracker.body.anatomy import posture
from markerless_tracker.body.angles import AngleReader

PLAIN, BODY = load_body("person31", 1.75), load_body("person32", 1.75)
BEND = BODY.index("thorax_x")


def named(body, pose):
    return dict(zip(MARKER_NAMES, markers(body, pose), strict=True))


def test_it_is_person31_with_one_more_joint() -> None:
    names = tuple(name for name in BODY.parameter_names if name != "thorax_x")
    assert names == PLAIN.parameter_names and BODY.cone_names == PLAIN.cone_names
    rng = np.random.default_rng(0)
    pose = PLAIN.neutral + rng.uniform(-0.3, 0.3, PLAIN.size)
    longer = np.insert(pose, BEND, 0.0)
    np.testing.assert_allclose(markers(BODY, longer), markers(PLAIN, pose), atol=1e-12)
    np.testing.assert_allclose(
        cone_transforms(BODY, longer), cone_transforms(PLAIN, pose), atol=1e-12
    )
    assert BEND in BODY.subspaces["torso"] and BEND in BODY.subspaces["torso_head"]


def test_a_positive_bend_is_to_the_left() -> None:
    pose = posture(BODY, {"thorax_x": 0.3})
    left = markers(BODY, BODY.neutral)[MARKER_NAMES.index("LHip")]
    neck = MARKER_NAMES.index("Neck")
    moved = markers(BODY, pose)[neck] - markers(BODY, BODY.neutral)[neck]
    assert moved[:2] @ left[:2] > 0.0
    assert AngleReader(BODY).read(pose).degrees()["lumbar_bending"] == pytest.approx(
        -np.rad2deg(0.3)
    )


def test_the_hips_of_a_person_who_leans_are_found() -> None:
    leaning = posture(BODY, {"thorax_x": 0.3, "thorax_y": 0.3, "l_hip_y": 0.4})
    target = markers(BODY, leaning)
    hips = [MARKER_NAMES.index("LHip"), MARKER_NAMES.index("RHip")]

    def worst_hip_m(body):
        found = markers(body, pose_from_markers(body, named(BODY, leaning)))
        return float(np.linalg.norm(found - target, axis=1)[hips].max())

    assert worst_hip_m(BODY) < 0.001
    assert worst_hip_m(PLAIN) > 0.01


def test_a_likely_start_shares_a_stoop_by_the_prior() -> None:
    """Markers do not show how far the pelvis tilts: a trunk bends less than hips do."""
    stoop = posture(BODY, {"thorax_y": 0.6, "pelvis_ry": 0.6, "l_hip_y": 0.6, "r_hip_y": 0.6})
    target = markers(BODY, stoop)
    bend = BODY.index("thorax_y")
    plain, likely = (
        pose_from_markers(BODY, named(BODY, stoop), likely=choice) for choice in (False, True)
    )
    assert abs(likely[bend]) < 0.5 * abs(plain[bend])
    np.testing.assert_allclose(markers(BODY, likely), target, atol=0.003)


def test_standing_is_feasible() -> None:
    assert Feasibility(BODY, BODY.limits, "elliptic")(BODY.neutral[None])[0]
