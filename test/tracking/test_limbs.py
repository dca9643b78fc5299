"""A limb that lies outside the silhouettes is found again."""

import numpy as np
import pytest

from markerless_tracker.body import MARKER_NAMES, markers
from markerless_tracker.records import Observation
from markerless_tracker.synthesis import SyntheticScene
from markerless_tracker.tracking import TrackerConfig
from markerless_tracker.tracking.limbs import FOUND_ABOVE, LOST_BELOW, LimbWatch, limb_shares
from markerless_tracker.tracking.search import Searcher

ARM = [MARKER_NAMES.index(name) for name in ("LElbow", "LWrist")]


@pytest.fixture(scope="module")
def standing():
    scene = SyntheticScene(body="person31", motion="stand", size_px=(328, 245), seed=3)
    _, masks, pose = scene.frame(0)
    seen = {
        name: Observation.from_mask(name, 0, mask, np.zeros(mask.shape, np.uint8))
        for name, mask in masks.items()
    }
    raised = pose.copy()
    raised[scene.body.index("l_shoulder_x")] += 2.0
    return scene, seen, pose, raised


def test_shares_tell_the_limb_that_is_off(standing) -> None:
    scene, seen, pose, raised = standing
    true = limb_shares(scene.body, pose, seen, scene.rig)
    assert set(true) == {"l_arm", "r_arm", "l_leg", "r_leg"}
    assert min(true.values()) > 0.9
    wrong = limb_shares(scene.body, raised, seen, scene.rig)
    assert wrong["l_arm"] < LOST_BELOW < FOUND_ABOVE < wrong["r_arm"] == true["r_arm"]


def test_a_lost_arm_is_found_alone(standing) -> None:
    scene, seen, pose, raised = standing
    body = scene.body
    searcher = Searcher(scene.rig, body, TrackerConfig(threads=1), limits=body.limits, threads=1)
    watch = LimbWatch(scene.rig)
    found, notes = watch.mend(searcher, seen, 0, raised)
    assert notes == ("l_arm: lost, looked for alone",)
    gap = np.linalg.norm(markers(body, found) - markers(body, pose), axis=1)
    before = np.linalg.norm(markers(body, raised) - markers(body, pose), axis=1)
    assert before[ARM].min() > 0.3 and gap[ARM].max() < 0.08
    again, notes = watch.mend(searcher, seen, 1, found)
    assert again is found and notes == ()


def test_limbs_in_their_place_are_left_alone(standing) -> None:
    scene, seen, pose, _ = standing
    body = scene.body
    searcher = Searcher(scene.rig, body, TrackerConfig(threads=1), limits=body.limits, threads=1)
    assert LimbWatch(scene.rig).mend(searcher, seen, 0, pose) == (pose, ())
