"""The start beside the steps: the same bytes however long a search takes, no pose is waited for."""

import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from markerless_tracker.body import load_body, markers
from markerless_tracker.body.anatomy import heading, heading_difference
from markerless_tracker.records import CONTOUR, Observation, TrackState
from markerless_tracker.synthesis import SyntheticScene
from markerless_tracker.tracking import TrackerConfig, build_tracker
from markerless_tracker.tracking.evidence.seen import Seen
from markerless_tracker.tracking.search import make_searcher
from markerless_tracker.tracking.start.automatic import (
    REST_NS,
    SEARCH_NS,
    _followed,
    _same,
    stages_of,
)
from markerless_tracker.tracking.start.estimate import StartEstimate
from markerless_tracker.tracking.start.starter import GAP_NS, Starter
from markerless_tracker.tracking.start.two_headings import SETTLING_FRAMES

AUTOMATIC = "markerless_tracker.tracking.start.automatic"
BODY = load_body("person31")
STEP = 3
"""Frames of 1/60 s between two sets."""
SETS = 31


@pytest.fixture(scope="module")
def walk(take_frames):
    """Stamps, observations and true markers of a walking person."""
    scene = SyntheticScene(body="person31", motion="walk", size_px=(328, 245), seed=2)
    return scene, take_frames(scene, range(0, STEP * SETS, STEP))


def tracker_of(scene):
    return build_tracker(scene.rig, TrackerConfig(threads=1), stature=1.72).tracker


def error_mm(result, points) -> float:
    return 1e3 * float(np.linalg.norm(result.markers_m - points, axis=1).mean())


def nobody(seen) -> dict[str, Observation]:
    """The same views without a silhouette."""
    return {
        name: Observation.from_mask(name, 0, np.zeros_like(view.mask, np.uint8), view.edges)
        for name, view in seen.items()
    }


def fails(*_):
    raise ValueError("in the search")


def count_searches(monkeypatch) -> list[int]:
    """The stamps of the frames that the starter searches."""
    searched: list[int] = []
    step = Starter.step

    def noted(self, observed, stamp_ns, tracked=None):
        searched.append(stamp_ns)
        return step(self, observed, stamp_ns, tracked)

    monkeypatch.setattr(Starter, "step", noted)
    return searched


def test_the_person_is_tracked_in_every_set_and_the_start_is_completed(walk, monkeypatch) -> None:
    scene, taken = walk
    searched = count_searches(monkeypatch)
    tracker = tracker_of(scene)
    results = [tracker.step(seen, stamp, 0.5) for stamp, seen, _ in taken]
    assert all(result.state is TrackState.TRACKING for result in results)
    assert max(error_mm(r, t[2]) for r, t in zip(results, taken, strict=True)) < 120.0
    assert error_mm(results[-1], taken[-1][2]) < 60.0
    assert heading_difference(heading(results[-1].markers_m), heading(taken[-1][2])) < 0.5
    assert results[0].settling and not results[-1].settling
    # The first set is searched in its step, and each search taken by the second set after it.
    stamps = [stamp for stamp, _, _ in taken]
    last = 1 + 2 * (SETTLING_FRAMES - 1)
    assert searched == [stamps[0], *stamps[1:last:2]]
    settled = next(i for i, result in enumerate(results) if not result.settling)
    assert stamps[settled - 1] - stamps[last] < REST_NS <= stamps[settled] - stamps[last]


@pytest.mark.parametrize("delay_s", [0.0, 0.3])
def test_results_do_not_depend_on_how_long_a_search_takes(walk, monkeypatch, delay_s) -> None:
    scene, taken = walk
    step = Starter.step

    def slow(self, *arguments):
        time.sleep(delay_s)
        return step(self, *arguments)

    tracker = tracker_of(scene)
    expected = [tracker.step(seen, stamp, 0.5).pose for stamp, seen, _ in taken[:8]]
    monkeypatch.setattr(Starter, "step", slow)
    again = tracker_of(scene)
    poses = [again.step(seen, stamp, 0.5).pose for stamp, seen, _ in taken[:8]]
    np.testing.assert_array_equal(expected, poses)


def test_nor_on_when_the_evidence_is_made(walk) -> None:
    scene, taken = walk
    tracker = tracker_of(scene)
    expected = [tracker.step(seen, stamp, 0.5).pose for stamp, seen, _ in taken[:8]]
    tracker = tracker_of(scene)
    poses = []
    with ThreadPoolExecutor(1) as pool:
        ahead = pool.submit(tracker.prepare, taken[0][1], taken[0][0])
        for i in range(8):
            prepared = ahead.result()
            stamp, seen, _ = taken[i + 1]
            ahead = pool.submit(tracker.prepare, seen, stamp)
            poses.append(tracker.step(prepared, taken[i][0], 0.5).pose)
    np.testing.assert_array_equal(expected, poses)


def test_with_full_effort_again_the_search_is_taken_at_once(walk, monkeypatch) -> None:
    scene, taken = walk
    searched = count_searches(monkeypatch)
    tracker = tracker_of(scene)
    efforts = [1.0, 0.5, 1.0, 1.0, 1.0]
    for (stamp, seen, points), effort in zip(taken, efforts, strict=False):
        assert error_mm(tracker.step(seen, stamp, effort), points) < 120.0
    # The third set takes the search of the second, later ones are searched in their steps.
    assert searched == [taken[i][0] for i in (0, 1, 3, 4)]


def test_without_refinement_every_frame_is_searched_in_its_step(walk) -> None:
    scene, taken = walk
    config = TrackerConfig(threads=1, refinement="none")
    trackers = [build_tracker(scene.rig, config, stature=1.72).tracker for _ in range(2)]
    for stamp, seen, _ in taken[:4]:
        late, other = (t.step(seen, stamp, e) for t, e in zip(trackers, (0.5, 1.0), strict=True))
        assert late.settling
        np.testing.assert_array_equal(late.pose, other.pose)


def test_who_leaves_meanwhile_is_forgotten(walk) -> None:
    scene, taken = walk
    tracker = tracker_of(scene)
    for stamp, seen, _ in taken[:3]:
        tracker.step(seen, stamp, 0.5)
    result = tracker.step(nobody(taken[0][1]), taken[3][0], 0.5)
    assert result.state is TrackState.SEARCHING and result.pose is None
    stamp, seen, points = taken[4]
    assert error_mm(tracker.step(seen, stamp, 0.5), points) < 120.0


def test_other_settings_wait_for_what_runs_and_a_reset_forgets_it(walk, monkeypatch) -> None:
    scene, taken = walk
    ended: list[int] = []
    step = Starter.step

    def slow(self, *arguments):
        time.sleep(0.2)
        found = step(self, *arguments)
        ended.append(arguments[1])
        return found

    monkeypatch.setattr(Starter, "step", slow)
    tracker = tracker_of(scene)
    for stamp, seen, _ in taken[:2]:
        tracker.step(seen, stamp, 0.5)
    tracker.configure(tracker.config)
    assert ended == [taken[0][0], taken[1][0]]
    first = tracker.step(taken[2][1], taken[2][0], 0.5).pose
    tracker.reset()
    assert tracker.state is TrackState.SEARCHING
    for stamp, seen, _ in taken[:2]:
        tracker.step(seen, stamp, 0.5)
    np.testing.assert_array_equal(tracker.step(taken[2][1], taken[2][0], 0.5).pose, first)


def test_what_was_found_may_prove_to_be_no_person(walk, monkeypatch) -> None:
    """Then the next set is searched anew."""
    scene, taken = walk
    tracker = tracker_of(scene)
    tracker.step(taken[0][1], taken[0][0], 0.5)
    with monkeypatch.context() as patch:
        patch.setattr("markerless_tracker.tracking.start.starter.LEAST_FIT", 1.0)
        assert tracker.step(taken[1][1], taken[1][0], 0.5).state is TrackState.TRACKING
        assert tracker.step(taken[3][1], taken[3][0], 0.5).state is TrackState.SEARCHING
    stamp, seen, points = taken[4]
    assert error_mm(tracker.step(seen, stamp, 0.5), points) < 120.0


def test_an_error_of_a_search_is_raised_once(walk, monkeypatch) -> None:
    scene, taken = walk
    tracker = tracker_of(scene)
    tracker.step(taken[0][1], taken[0][0], 0.5)

    with monkeypatch.context() as patch:
        patch.setattr(Starter, "step", fails)
        tracker.step(taken[1][1], taken[1][0], 0.5)
        with pytest.raises(ValueError, match="in the search"):
            tracker.step(taken[3][1], taken[3][0], 0.5)
    stamp, seen, points = taken[4]
    assert error_mm(tracker.step(seen, stamp, 0.5), points) < 120.0


def test_an_error_is_raised_even_if_the_person_has_left(walk, monkeypatch) -> None:
    scene, taken = walk
    tracker = tracker_of(scene)
    tracker.step(taken[0][1], taken[0][0], 0.5)

    monkeypatch.setattr(Starter, "step", fails)
    tracker.step(taken[1][1], taken[1][0], 0.5)
    with pytest.raises(ValueError, match="in the search"):
        tracker.step(nobody(taken[1][1]), taken[2][0], 0.5)
    # The person was forgotten, so there is nothing to raise again.
    assert tracker.step(nobody(taken[1][1]), taken[3][0], 0.5).state is TrackState.SEARCHING


def test_what_completes_a_start_is_followed_from_the_frame_that_was_searched(
    walk, monkeypatch
) -> None:
    """Its pose is one of that frame, not of the frame in which the search was taken."""
    scene, taken = walk
    followed: list[list[int]] = []

    def noted(searcher, pose, frames):
        followed.append([seen.stamp_ns for seen in frames])
        return _followed(searcher, pose, frames)

    searched = count_searches(monkeypatch)
    monkeypatch.setattr(f"{AUTOMATIC}._same", lambda *_: False)
    monkeypatch.setattr(f"{AUTOMATIC}._followed", noted)
    tracker = tracker_of(scene)
    for stamp, seen, _ in taken:
        tracker.step(seen, stamp, 0.5)
    stamps = [stamp for stamp, _, _ in taken]
    last = stamps.index(searched[-1])
    settled = next(i for i, at in enumerate(stamps) if at - stamps[last + 2] >= REST_NS)
    assert followed[-1] == stamps[last + 1 : settled]


def changed(**angles_rad: float) -> np.ndarray:
    """The neutral pose with some angles added."""
    pose = BODY.neutral.copy()
    for name, angle_rad in angles_rad.items():
        pose[BODY.index(name)] += angle_rad
    return pose


@pytest.mark.parametrize(
    "pose, same",
    [(changed(), True), (changed(r_elbow=0.3), True), (changed(r_shoulder_y=1.5), False)],
)
def test_a_pose_with_a_limb_elsewhere_is_another_one(pose, same) -> None:
    assert _same(BODY, pose, BODY, BODY.neutral) is same


def test_a_pose_of_an_earlier_frame_is_followed_through_the_frames_since(walk) -> None:
    scene, taken = walk
    config = TrackerConfig(threads=1)
    searcher = make_searcher(scene.body, rig=scene.rig, config=config, threads=1)
    since = [Seen(stamp, seen, seen, seen) for stamp, seen, _ in taken[1:11]]

    def far_mm(frames):
        found = _followed(searcher, scene.motion.pose(0.0), frames)
        gaps_m = np.linalg.norm(markers(scene.body, found) - taken[10][2], axis=1)
        return 1e3 * float(gaps_m.max())

    assert far_mm(since) < 60.0 < 200.0 < far_mm(since[-1:])


def test_it_is_followed_in_frames_some_time_apart(walk, monkeypatch) -> None:
    scene, taken = walk
    config = TrackerConfig(threads=1)
    searcher = make_searcher(scene.body, rig=scene.rig, config=config, threads=1)
    frames = [
        Seen(number * 16_666_667, taken[0][1], taken[0][1], taken[0][1]) for number in range(8)
    ]
    stamps: list[int] = []
    frame = searcher.frame

    def noted(observations, stamp_ns, *arguments, **options):
        stamps.append(stamp_ns)
        return frame(observations, stamp_ns, *arguments, **options)

    monkeypatch.setattr(searcher, "frame", noted)
    _followed(searcher, scene.motion.pose(0.0), frames)
    assert stamps == [frames[i].stamp_ns for i in (0, 3, 6)]


def test_a_doubtful_first_pose_is_not_followed(walk, monkeypatch) -> None:
    """The second set is searched in its step, independently of the first."""
    monkeypatch.setattr("markerless_tracker.tracking.start.starter._SURE_GAP", 1.0)
    scene, taken = walk
    tracker, others = tracker_of(scene), tracker_of(scene)
    for stamp, seen, _ in taken[:2]:
        result, other = tracker.step(seen, stamp, 0.5), others.step(seen, stamp)
        np.testing.assert_array_equal(result.pose, other.pose)
    stamp, seen, _ = taken[2]
    assert (tracker.step(seen, stamp, 0.5).pose != others.step(seen, stamp).pose).any()


def test_the_stages_of_an_estimate() -> None:
    scene = SyntheticScene(body="person31", size_px=(328, 245))
    config = TrackerConfig(threads=1)
    searcher = make_searcher(BODY, rig=scene.rig, config=config, threads=1)

    def algorithms(**flags):
        found = StartEstimate(searcher, BODY.neutral, {}, **flags)
        return [stage.plan.algorithm for stage in stages_of(found, BODY, config)]

    assert algorithms(settled=False) == []
    assert algorithms(settled=False, predicted=True) == [CONTOUR]
    settled = algorithms(settled=True, predicted=True)
    assert settled[0] == settled[-1] == CONTOUR and len(settled) > 2


def test_searches_are_taken_before_a_refinement_cannot_reach_the_person() -> None:
    assert SEARCH_NS < GAP_NS < REST_NS
