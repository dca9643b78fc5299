"""person32: person31 with a trunk that bends to the side, and with upright feet."""

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
    others = [c for c, name in enumerate(BODY.cone_names) if not name.endswith("foot")]
    np.testing.assert_allclose(
        cone_transforms(BODY, longer)[others], cone_transforms(PLAIN, pose)[others], atol=1e-12
    )
    np.testing.assert_array_equal(BODY.cone_shape[others], PLAIN.cone_shape[others])
    assert BEND in BODY.subspaces["torso"] and BEND in BODY.subspaces["torso_head"]


@pytest.mark.parametrize("side", ["l", "r"])
def test_sections_of_a_foot_are_parallel_to_its_sole(side) -> None:
    """A shank that stands upright has a level sole, from behind the ankle to in front of it."""
    foot = BODY.cone_names.index(f"{side}_foot")
    ankle = named(BODY, BODY.neutral)[side.upper() + "Ankle"]
    place = cone_transforms(BODY, BODY.neutral)[foot]
    radius, _, ahead, aside = BODY.cone_shape[foot, 1]
    ends = [[ahead + end * radius, aside, BODY.cone_length[foot]] for end in (-1.0, 1.0)]
    toe, heel = (place[:, :3] @ end + place[:, 3] - ankle for end in ends)
    assert toe[2] == pytest.approx(heel[2]) and -0.09 < toe[2] < -0.08
    assert -0.07 < heel[0] < -0.04 and 0.16 < toe[0] < 0.20
    np.testing.assert_allclose([toe[1], heel[1]], 0.0, atol=1e-9)


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
