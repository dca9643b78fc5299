"""Angles of a pose near given ones."""

import numpy as np
import pytest

from markerless_tracker.body import load_body
from markerless_tracker.body.angles import AngleReader
from markerless_tracker.results.pose_angles import PoseAngles

BODY = load_body("person32", 1.75)
ARM = ("arm_flex_l", "arm_add_l", "arm_rot_l")


@pytest.fixture
def reader() -> PoseAngles:
    return PoseAngles(BODY)


@pytest.fixture
def pose() -> np.ndarray:
    found = BODY.neutral + np.random.default_rng(4).uniform(-0.3, 0.3, BODY.size)
    found[BODY.index("pelvis_rz")] = 2.8
    return found


def test_without_others_they_are_those_of_a_first_frame(reader, pose) -> None:
    first = AngleReader(BODY)
    assert reader.names == first.names
    turned = (reader.read(pose) - first.read(pose).values_rad) / (2.0 * np.pi)
    np.testing.assert_allclose(turned, np.round(turned), atol=1e-12)


def test_full_turns_and_the_other_solution_follow_the_given_angles(reader, pose) -> None:
    first = reader.read(pose)
    columns = [reader.names.index(name) for name in ARM]
    near = first.copy()
    near[reader.names.index("pelvis_rotation")] += 4.0 * np.pi
    near[columns] = first[columns] * [1.0, -1.0, 1.0] + np.pi
    near[reader.names.index("knee_angle_l")] += 0.2
    found = reader.read(pose, near)
    knee = reader.names.index("knee_angle_l")
    assert found[knee] == pytest.approx(first[knee])
    others = [k for k in range(len(found)) if k != knee]
    np.testing.assert_allclose(found[others], near[others], atol=1e-12)


def test_the_distance_from_a_singularity(reader, pose) -> None:
    angles = np.zeros(len(reader.names))
    columns = [reader.names.index(name) for name in ARM]
    assert (reader.apart(angles) == 1.0).all()
    angles[columns[1]] = -0.5 * np.pi
    assert np.abs(reader.apart(angles)[columns]).max() < 1e-12
    angles[columns[1]] = np.deg2rad(-60.0)
    found = reader.apart(angles)
    assert (found[columns] > 0.5).all() and (found[columns] < 1.0).all()
    assert np.delete(found, columns).min() == 1.0
