"""A person that is found stands on the floor and takes a posture that people take."""

import numpy as np
import pytest

from markerless_tracker.body import load_description, markers
from markerless_tracker.body.anatomy import posture
from markerless_tracker.body.model import MARKER_NAMES
from markerless_tracker.body.sizes import Sizes
from markerless_tracker.tracking.candidates.posture_costs import (
    MOST_COST,
    UNLIKE_COST_PER_M2,
    UNLIKE_MOST_M,
    off_floor,
    unlike_postures,
)
from markerless_tracker.tracking.candidates.postures import POSTURES

BODY = Sizes(load_description("person31")).of_stature(1.70)
ANKLES = [MARKER_NAMES.index("LAnkle"), MARKER_NAMES.index("RAnkle")]
UP = BODY.index("pelvis_tz")


def on_floor(**angles: float) -> np.ndarray:
    """A pose (p,) with its lower ankle 9 cm above the floor."""
    pose = posture(BODY, angles)
    pose[UP] += 0.09 - markers(BODY, pose)[ANKLES, 2].min()
    return pose


def cost(pose: np.ndarray) -> float:
    return float(off_floor(BODY, pose[None])[0])


@pytest.mark.parametrize("number", [0, 1, 2, 11, 12, 13, 15])
def test_people_who_stand_walk_squat_or_sit_cost_nothing(number: int) -> None:
    assert cost(on_floor(**POSTURES[number])) == 0.0


def test_a_raised_leg_costs_less_than_legs_in_the_air() -> None:
    kick = on_floor(l_hip_y=1.6)
    flying = on_floor(l_hip_y=1.6, r_hip_y=1.6)
    flying[UP] += 0.7
    assert 0.0 < cost(kick) < 0.1 < cost(flying)


def test_feet_in_the_floor_cost_more_the_deeper_they_are() -> None:
    costs = []
    for depth_m in (0.0, 0.05, 0.10, 0.15):
        pose = on_floor()
        pose[UP] -= depth_m
        costs.append(cost(pose))
    assert costs[0] == 0.0 and all(b > a for a, b in zip(costs, costs[1:], strict=False))


def test_another_floor_costs_all_poses_the_same() -> None:
    poses = np.array([on_floor(), on_floor(l_hip_y=0.8, l_knee=0.4)])
    for shift_m in (-1.0, 1.0):
        poses[:, UP] += shift_m
        np.testing.assert_allclose(off_floor(BODY, poses), MOST_COST)
        poses[:, UP] -= shift_m


def unlike(pose: np.ndarray) -> float:
    return float(unlike_postures(BODY, pose[None])[0])


@pytest.mark.parametrize("number", range(len(POSTURES)))
def test_a_known_posture_costs_nothing_anywhere_and_in_any_heading(number: int) -> None:
    pose = posture(BODY, POSTURES[number])
    pose[[BODY.index(f"pelvis_t{axis}") for axis in "xyz"]] += (1.0, -2.0, 0.3)
    pose[BODY.index("pelvis_rz")] += 2.0
    assert unlike(pose) < 1e-12


def test_the_cost_is_that_of_the_markers_distances_each_limited() -> None:
    pose = posture(BODY, {})
    bent = posture(BODY, {"l_elbow": 0.3})
    moved_m = np.linalg.norm(markers(BODY, bent) - markers(BODY, pose), axis=1)
    assert unlike(bent) == pytest.approx(UNLIKE_COST_PER_M2 * (moved_m**2).sum(), rel=1e-6)
    # One leg to the side moves only its knee and its ankle.
    assert unlike(posture(BODY, {"l_hip_x": 1.5})) <= UNLIKE_COST_PER_M2 * 2 * UNLIKE_MOST_M**2


def test_a_crouch_upside_down_costs_more_than_a_kick() -> None:
    crouch = posture(BODY, {"l_hip_y": 2.0, "r_hip_y": 2.0, "l_knee": 2.0, "r_knee": 2.0})
    crouch[BODY.index("pelvis_ry")] += np.pi
    kick = posture(BODY, {"l_hip_y": 1.6, "l_knee": 0.1})
    assert unlike(kick) < 0.04 < unlike(crouch)
