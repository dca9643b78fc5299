"""A limb that lies outside the silhouettes is found again."""

import numpy as np
import pytest

from markerless_tracker.body import MARKER_NAMES, markers
from markerless_tracker.records import Observation
from markerless_tracker.synthesis import SyntheticScene
from markerless_tracker.tracking import TrackerConfig
from markerless_tracker.tracking.limbs import (
    CHECK_EVERY,
    FOUND_ABOVE,
    LOST_BELOW,
    LimbWatch,
    limb_shares,
)
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


@pytest.fixture(scope="module")
def hidden():
    """Somebody whose arm is stretched out, and a pose in which it hangs before the trunk."""
    scene = SyntheticScene(body="person31", motion="balance", size_px=(328, 245), seed=3)
    _, masks, pose = scene.frame(0)
    seen = {
        name: Observation.from_mask(name, 0, mask, np.zeros(mask.shape, np.uint8))
        for name, mask in masks.items()
    }
    body = scene.body
    wrong = pose.copy()
    wrong[body.subspaces["l_arm"]] = body.neutral[body.subspaces["l_arm"]]
    wrong[body.index("l_shoulder_x")] -= 0.35
    return scene, seen, pose, wrong


def looks(hidden, count: int):
    """Poses and notes of some frames with the wrong pose, with so many views."""
    scene, seen, _, wrong = hidden
    views = dict(list(seen.items())[:count])
    rig = scene.rig.selected(tuple(views))
    body = scene.body
    searcher = Searcher(rig, body, TrackerConfig(threads=1), limits=body.limits, threads=1)
    watch = LimbWatch(rig)
    return [
        watch.mend(searcher, views, stamp, wrong) for stamp in range(CHECK_EVERY * len(body.limbs))
    ]


def test_with_few_views_an_arm_that_hides_is_found_in_its_turn(hidden) -> None:
    scene, seen, pose, wrong = hidden
    assert limb_shares(scene.body, wrong, seen, scene.rig)["l_arm"] > LOST_BELOW
    true = markers(scene.body, pose)[ARM]
    found = []
    for tried, notes in looks(hidden, 3):
        assert notes == ()
        found.append(np.linalg.norm(markers(scene.body, tried)[ARM] - true, axis=1).max() < 0.08)
    assert sum(found) == 1
    assert np.linalg.norm(markers(scene.body, wrong)[ARM] - true, axis=1).min() > 0.2


def test_with_more_views_no_limb_is_checked_in_turn(hidden) -> None:
    _, _, _, wrong = hidden
    assert all(tried is wrong and notes == () for tried, notes in looks(hidden, 4))
