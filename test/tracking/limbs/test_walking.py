"""A body that does not face the walking direction is rotated."""

import numpy as np
import pytest

from markerless_tracker.body import load_body, markers
from markerless_tracker.body.anatomy import heading, heading_difference
from markerless_tracker.records import Observation
from markerless_tracker.synthesis import SyntheticScene
from markerless_tracker.tracking import TrackerConfig
from markerless_tracker.tracking.candidates.mirror import TRUNK, rotated_by
from markerless_tracker.tracking.evidence.seen import Seen
from markerless_tracker.tracking.limbs.walking import (
    EVERY_NS,
    LEAST_ANGLE_RAD,
    LEAST_SPEED_M_S,
    LEAST_WALKED_NS,
    WALKED_NS,
    WalkingWatch,
)
from markerless_tracker.tracking.limbs.watch import LimbWatch
from markerless_tracker.tracking.search import Searcher

BODY = load_body("person31", 1.75)
STEP_NS = 50_000_000


def walk_along(watch, direction_rad, faced_rad, speed_m_s, count, begin_ns=0):
    """What a walk along a way proposes, frame after frame; with the poses."""
    found = []
    for k in range(count):
        pose = BODY.neutral.copy()
        pose[BODY.index("pelvis_rz")] = faced_rad
        pose[BODY.index("l_hip_y")] += 0.4
        metres = speed_m_s * k * STEP_NS * 1e-9
        pose[BODY.index("pelvis_tx")] += metres * np.cos(direction_rad)
        pose[BODY.index("pelvis_ty")] += metres * np.sin(direction_rad)
        watch.note(BODY, pose, begin_ns + k * STEP_NS)
        found.append((pose, watch.take_due(BODY, pose, BODY.limits, begin_ns + k * STEP_NS)))
    return found


@pytest.mark.parametrize("off_rad", [1.0, -1.5, np.pi])
def test_a_body_that_walks_another_way_is_turned_to_it(off_rad) -> None:
    found = walk_along(WalkingWatch(), 0.5, 0.5 + off_rad, 1.0, 12)
    first = next(k for k, (_, poses) in enumerate(found) if poses)
    assert first == LEAST_WALKED_NS // STEP_NS
    pose, (same, mirrored) = found[first]
    for other in (same, mirrored):
        assert heading_difference(heading(markers(BODY, other)), 0.5) < 0.1
        trunks = [markers(BODY, one)[TRUNK].mean(axis=0) for one in (other, pose)]
        np.testing.assert_allclose(*trunks, atol=1e-9)
    hips = [BODY.index(f"{side}_hip_y") for side in "lr"]
    np.testing.assert_allclose(same[hips], pose[hips])
    np.testing.assert_allclose(mirrored[hips], pose[hips[::-1]])
    # Then again at intervals.
    again = [k for k, (_, poses) in enumerate(found) if poses]
    assert np.diff(again).min() * STEP_NS >= EVERY_NS > STEP_NS


@pytest.mark.parametrize(
    ("off_rad", "speed_m_s"), [(0.9 * LEAST_ANGLE_RAD, 1.0), (np.pi, 0.9 * LEAST_SPEED_M_S)]
)
def test_a_body_that_faces_about_that_way_or_hardly_walks_stays(off_rad, speed_m_s) -> None:
    found = walk_along(WalkingWatch(), 2.0, 2.0 + off_rad, speed_m_s, 12)
    assert not any(poses for _, poses in found)


def test_an_earlier_walk_is_forgotten() -> None:
    watch = WalkingWatch()
    assert any(poses for _, poses in walk_along(watch, 0.0, np.pi, 1.0, 12))
    still = walk_along(watch, 0.0, np.pi, 0.0, 30, begin_ns=20 * STEP_NS)
    assert not any(poses for _, poses in still[WALKED_NS // STEP_NS + 1 :])
    # Time that was set back begins anew.
    back = walk_along(watch, 0.0, np.pi, 1.0, 12)
    first = next(k for k, (_, poses) in enumerate(back) if poses)
    assert first == LEAST_WALKED_NS // STEP_NS


@pytest.mark.parametrize("step_s, proposes", [(0.53, True), (1.0, True), (2.5, False)])
def test_frames_that_come_seldom_tell_the_direction(step_s: float, proposes: bool) -> None:
    watch, found = WalkingWatch(), []
    for k in range(4):
        pose, stamp_ns = BODY.neutral.copy(), round(k * step_s * 1e9)
        pose[BODY.index("pelvis_rz")] = np.pi
        pose[BODY.index("pelvis_tx")] += k * step_s
        watch.note(BODY, pose, stamp_ns)
        found.append(bool(watch.take_due(BODY, pose, BODY.limits, stamp_ns)))
    assert found == [False, *[proposes] * 3]


def test_a_walker_who_is_tracked_sideways_is_turned() -> None:
    scene = SyntheticScene(body="person31", motion="walk", size_px=(328, 245), seed=3)
    body, config = scene.body, TrackerConfig(threads=1)
    searcher = Searcher(scene.rig, body, config, limits=body.limits, threads=1)
    watch = LimbWatch(scene.rig)
    for frame in range(0, 30, 3):
        _, masks, true = scene.frame(frame)
        seen = {
            name: Observation.from_mask(name, 0, mask, np.zeros(mask.shape, np.uint8))
            for name, mask in masks.items()
        }
        pose = np.clip(rotated_by(body, true, 1.6, about=true), *body.limits)
        stamp_ns = round(frame * 1e9 / 60)
        contours = searcher.frame(seen, stamp_ns, pose).contours
        found = watch.recover(searcher, contours, Seen(stamp_ns, seen, seen, seen), pose)
        assert found.rotated == (stamp_ns >= LEAST_WALKED_NS)
        if found.rotated:
            headings = [heading(markers(body, one)) for one in (found.pose, true)]
            assert heading_difference(*headings) < 0.2
            assert found.notes == ("the person faces another way: turned round",)
            return
    raise AssertionError("never turned")
