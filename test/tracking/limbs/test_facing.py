"""A person that is tracked facing the wrong way is turned round."""

import numpy as np
import pytest

from markerless_tracker.body import markers
from markerless_tracker.body.anatomy import heading, heading_difference
from markerless_tracker.records import Observation
from markerless_tracker.synthesis import SyntheticScene
from markerless_tracker.tracking import Tracker, TrackerConfig
from markerless_tracker.tracking.candidates.mirror import OppositeHeading, rotated_by
from markerless_tracker.tracking.candidates.own_evidence import OwnEvidence
from markerless_tracker.tracking.candidates.population import FramePopulation
from markerless_tracker.tracking.candidates.recombination import Recombiner
from markerless_tracker.tracking.limbs.facing import (
    DOUBTED_EVERY_NS,
    EVERY_NS,
    FIRST_EVERY_NS,
    FIRST_NS,
    LEAST_COMPARISONS,
    FacingWatch,
)
from markerless_tracker.tracking.limbs.search import LimbSearch
from markerless_tracker.tracking.search import Searcher


@pytest.fixture(scope="module")
def scene():
    return SyntheticScene(body="person31", motion="walk", size_px=(328, 245), seed=3)


def observed(scene, frame):
    _, masks, pose = scene.frame(frame)
    seen = {
        name: Observation.from_mask(name, 0, mask, np.zeros(mask.shape, np.uint8))
        for name, mask in masks.items()
    }
    return seen, pose


def turned_away(body, pose):
    return np.clip(OppositeHeading(body).of(pose), *body.limits)


def compared(scene, pose_of, count):
    """What so many comparisons give, one after another."""
    body, config = scene.body, TrackerConfig(threads=1)
    searcher = Searcher(scene.rig, body, config, limits=body.limits, threads=1)
    watch, found = FacingWatch(), []
    for number in range(count):
        seen, true = observed(scene, 15 * number)
        pose, stamp_ns = pose_of(true), number * EVERY_NS
        assert watch.take_due(stamp_ns) and not watch.take_due(stamp_ns + DOUBTED_EVERY_NS - 1)
        frame = FramePopulation(searcher, seen, stamp_ns, pose)
        own = OwnEvidence(searcher, seen, stamp_ns, frame)
        search = LimbSearch(Recombiner(body, body.limits), frame, own, pose, 0.001)
        found.append(watch.compare(search, body, body.limits))
    return found


@pytest.mark.parametrize("direction_rad", [np.pi, 1.3, -1.7])
def test_many_comparisons_turn_a_person_who_faces_the_wrong_way(scene, direction_rad) -> None:
    """Whichever of the turns is the best one, though others are better, too."""
    body = scene.body

    def wrong(true):
        if direction_rad == np.pi:
            return turned_away(body, true)
        return np.clip(rotated_by(body, true, direction_rad, about=true), *body.limits)

    found = compared(scene, wrong, 3 * LEAST_COMPARISONS + 3)
    first = next(k for k, pose in enumerate(found) if pose is not None)
    assert first >= 3 * (LEAST_COMPARISONS - 1)
    true = scene.frame(15 * first)[2]
    headings = [heading(markers(body, pose)) for pose in (found[first], true)]
    assert heading_difference(*headings) < 0.4


def test_a_person_who_faces_the_right_way_stays(scene) -> None:
    assert compared(scene, lambda true: true, 6) == [None] * 6


def test_a_tracker_that_starts_the_wrong_way_turns_the_person_round(scene) -> None:
    body = scene.body
    start = turned_away(body, scene.frame(0)[2])
    tracker = Tracker(scene.rig, body, TrackerConfig(threads=1), start_pose=start, shape_known=True)
    warnings = []
    for frame in range(0, 120, 4):
        seen, true = observed(scene, frame)
        result = tracker.step(seen, round(frame * 1e9 / 60))
        warnings += result.warnings
    assert "the person faces another way: turned round" in warnings
    headings = [heading(markers(body, pose)) for pose in (result.pose, true)]
    assert heading_difference(*headings) < 0.4


def test_at_first_comparisons_are_frequent() -> None:
    watch = FacingWatch()
    times = [t for t in range(0, 2 * FIRST_NS, 10_000_000) if watch.take_due(t)]
    gaps = np.diff(times)
    early = np.array(times[1:]) < FIRST_NS
    assert early.any() and set(gaps[early]) == {FIRST_EVERY_NS}
    assert set(gaps[~early][1:]) == {EVERY_NS}
