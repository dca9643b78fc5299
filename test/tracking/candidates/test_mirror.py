"""Limbs exchanged as in a mirror; a body turned round."""

import numpy as np
import pytest

from markerless_tracker.body import MARKER_NAMES, load_body, markers
from markerless_tracker.tracking.candidates.mirror import Mirror, OppositeHeading


@pytest.mark.parametrize("name", ["person31", "balan31", "humaneva34"])
def test_markers_of_the_limbs_are_mirrored(name) -> None:
    body = load_body(name, 1.7)
    rng = np.random.default_rng(3)
    limbs = [i for i, n in enumerate(body.parameter_names) if n[:2] in ("l_", "r_")]
    pose = body.neutral.copy()
    pose[limbs] += 0.3 * rng.standard_normal(len(limbs))
    before, after = markers(body, pose), markers(body, Mirror(body).of(pose))
    for k, marker in enumerate(MARKER_NAMES):
        if marker[0] == "L" and marker[1].isupper():
            other = MARKER_NAMES.index("R" + marker[1:])
            np.testing.assert_allclose(after[other], before[k] * [1.0, -1.0, 1.0], atol=1e-9)


def test_root_trunk_and_head_stay() -> None:
    body = load_body("person31", 1.7)
    pose = body.neutral + 0.1
    fixed = [i for i, n in enumerate(body.parameter_names) if n[:2] not in ("l_", "r_")]
    np.testing.assert_array_equal(Mirror(body).of(pose)[fixed], pose[fixed])


OTHER = [
    MARKER_NAMES.index({"L": "R", "R": "L"}[name[0]] + name[1:]) if name[1].isupper() else k
    for k, name in enumerate(MARKER_NAMES)
]
"""Row of the marker of the other side, for each marker."""


@pytest.mark.parametrize("name", ["balan31", "humaneva34"])
def test_a_body_turned_round_has_its_joints_where_those_of_the_other_side_were(name) -> None:
    body = load_body(name, 1.7)
    rng = np.random.default_rng(4)
    pose = body.neutral.copy()
    for angle in ("hip_y", "shoulder_y", "knee"):
        for side in "lr":
            pose[body.index(f"{side}_{angle}")] += 0.3 * rng.standard_normal()
    pose[[body.index(f"pelvis_{i}") for i in ("tx", "ty", "rz", "ry")]] = 0.4, -0.2, 2.0, 0.2
    turned = OppositeHeading(body).of(pose)
    before, after = markers(body, pose), markers(body, turned)
    np.testing.assert_allclose(after[OTHER], before, atol=0.002)


@pytest.mark.parametrize("name", ["person31", "person32", "person34"])
def test_legs_and_trunk_of_other_bodies_stay_near_where_they_were(name) -> None:
    body = load_body(name, 1.7)
    pose = body.neutral.copy()
    pose[[body.index("l_hip_y"), body.index("r_hip_y")]] += 0.3, -0.2
    before, after = markers(body, pose), markers(body, OppositeHeading(body).of(pose))
    rows = [
        k
        for k, marker in enumerate(MARKER_NAMES)
        if "Elbow" not in marker and "Wrist" not in marker
    ]
    gaps_m = np.linalg.norm(after[OTHER] - before, axis=1)
    assert gaps_m[rows].max() < 0.05


def test_turning_twice_changes_nothing() -> None:
    body = load_body("person32", 1.7)
    rng = np.random.default_rng(5)
    pose = body.neutral + 0.1 * rng.standard_normal(body.size)
    again = OppositeHeading(body).of(OppositeHeading(body).of(pose))
    again[body.index("pelvis_rz")] -= 2.0 * np.pi
    np.testing.assert_allclose(again, pose, atol=1e-9)
