"""The last search of a start finds what the searches with a generic body missed."""

import numpy as np
import pytest

from markerless_tracker.body import markers
from markerless_tracker.records import Observation
from markerless_tracker.synthesis import SyntheticScene
from markerless_tracker.tracking import TrackerConfig
from markerless_tracker.tracking.candidates.mirror import opposite_heading
from markerless_tracker.tracking.search import Searcher
from markerless_tracker.tracking.start.final_search import TURNED, searched_again


@pytest.fixture(scope="module")
def stride(take_frames):
    """A searcher with the person's body, the observations of a frame, and the true pose in it."""
    scene = SyntheticScene(body="person31", motion="walk", size_px=(328, 245), seed=3)
    pose, [(_, seen, _)] = scene.frame(12)[2], take_frames(scene, [12])
    body, config = scene.body, TrackerConfig(threads=1)
    return Searcher(scene.rig, body, config, limits=body.limits, threads=1), seen, pose


def off_m(body, pose, other) -> float:
    return float(np.linalg.norm(markers(body, pose) - markers(body, other), axis=1).max())


def test_who_is_turned_round_is_turned_back_and_it_is_said(stride) -> None:
    searcher, seen, pose = stride
    turned = opposite_heading(searcher.body).of(pose)
    found, notes = searched_again(searcher, turned, seen, 0, False)
    assert off_m(searcher.body, turned, pose) > 0.2 > 0.06 > off_m(searcher.body, found, pose)
    assert notes == (TURNED,)


def test_an_arm_in_another_place_is_found_and_nothing_is_said(stride) -> None:
    searcher, seen, pose = stride
    wrong = pose.copy()
    wrong[searcher.body.parameter_names.index("l_shoulder_x")] += 1.2
    found, notes = searched_again(searcher, wrong, seen, 0, False)
    assert off_m(searcher.body, wrong, pose) > 0.2 > 0.06 > off_m(searcher.body, found, pose)
    assert notes == ()


def test_the_right_pose_stays(stride) -> None:
    searcher, seen, pose = stride
    found, notes = searched_again(searcher, pose, seen, 0, False)
    assert off_m(searcher.body, found, pose) < 0.02
    assert notes == ()


def test_without_a_hull_the_pose_stays(stride) -> None:
    searcher, seen, pose = stride
    empty = {
        name: Observation.from_mask(name, 0, np.zeros_like(view.mask, np.uint8), view.edges)
        for name, view in seen.items()
    }
    found, notes = searched_again(searcher, pose, empty, 0, False)
    np.testing.assert_array_equal(found, pose)
    assert notes == ()
