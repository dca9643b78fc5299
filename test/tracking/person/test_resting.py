"""The resting posture that a measured start shows becomes the centre of the prior of poses."""

from dataclasses import replace

import numpy as np
import pytest

from markerless_tracker.synthesis import SyntheticScene
from markerless_tracker.tracking import Tracker, TrackerConfig
from markerless_tracker.tracking.person.resting import MOST_SD, NARROWER, at_rest


@pytest.fixture(scope="module")
def scene():
    return SyntheticScene(body="person31", motion="stand", size_px=(328, 245), seed=3)


def moved(body, **by):
    pose = body.prior_mean.copy()
    for name, value in by.items():
        pose[body.index(name)] += value
    return pose


def shift(body, **by) -> dict[str, float]:
    change = at_rest(body, moved(body, **by)).prior_mean - body.prior_mean
    return {
        name: round(float(value), 9)
        for name, value in zip(body.parameter_names, change, strict=True)
        if value
    }


def test_what_is_alike_on_both_sides_is_the_person(scene) -> None:
    body = scene.body
    both = {"l_clavicle_x": 0.2, "r_clavicle_x": -0.2, "l_clavicle_y": 0.1, "r_clavicle_y": 0.1}
    assert shift(body, **both, head_y=-0.4) == {**both, "head_y": -0.4}


def test_what_differs_between_the_sides_is_posture(scene) -> None:
    assert shift(scene.body, r_clavicle_x=-0.2) == {"l_clavicle_x": 0.1, "r_clavicle_x": -0.1}
    assert shift(scene.body, l_clavicle_x=0.2, r_clavicle_x=0.2, thorax_z=0.3) == {}


def test_a_deep_bend_is_posture_beyond_what_people_differ_by(scene) -> None:
    body = scene.body
    most = MOST_SD * float(body.prior_sd[body.index("thorax_y")])
    assert shift(body, thorax_y=0.9) == {"thorax_y": pytest.approx(most)}
    assert shift(body, l_hip_y=0.5, l_elbow=-0.5, l_shoulder_x=0.5) == {}


def test_trunk_and_shoulders_move_less_about_it(scene) -> None:
    body = scene.body
    ratio = at_rest(body, body.prior_mean).prior_sd / np.where(body.prior_sd > 9, 9, body.prior_sd)
    for name in ("thorax_y", "thorax_z", "l_clavicle_x", "r_clavicle_y"):
        assert ratio[body.index(name)] == NARROWER
    assert ratio[body.index("l_elbow")] == ratio[body.index("head_y")] == 1.0


@pytest.mark.parametrize("measured", [True, False])
def test_a_tracker_takes_it_from_a_start_with_measured_lengths(scene, measured) -> None:
    body = replace(scene.body, measured=measured)
    start = moved(body, l_clavicle_x=0.1, r_clavicle_x=-0.1)
    start[body.index("pelvis_tz")] = 0.9
    tracker = Tracker(scene.rig, body, TrackerConfig(threads=1), start_pose=start)
    gained = tracker.body.prior_mean - body.prior_mean
    assert gained[body.index("l_clavicle_x")] == pytest.approx(0.1 if measured else 0.0)
