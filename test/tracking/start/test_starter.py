"""Starting without a start pose."""

from dataclasses import replace

import numpy as np
import pytest

from markerless_tracker.body import markers
from markerless_tracker.body.anatomy import heading, heading_difference
from markerless_tracker.records import Observation, TrackState
from markerless_tracker.synthesis import SyntheticScene
from markerless_tracker.tracking import TrackerConfig, build_tracker
from markerless_tracker.tracking.candidates.crossed import in_each_others_place, is_crossed
from markerless_tracker.tracking.candidates.mirror import opposite_heading
from markerless_tracker.tracking.candidates.population import FramePopulation
from markerless_tracker.tracking.evidence.hull import find_hulls
from markerless_tracker.tracking.start.starter import GAP_NS
from markerless_tracker.tracking.start.two_headings import SETTLING_FRAMES

FRAMES = SETTLING_FRAMES + 2
STARTER = "markerless_tracker.tracking.start.starter"


@pytest.fixture(scope="module")
def walk(take_frames):
    """Stamps, observations and true markers of a walking person."""
    scene = SyntheticScene(body="person31", motion="walk", size_px=(328, 245), seed=2)
    return scene, take_frames(scene, range(FRAMES))


def tracker_of(scene, **subject):
    return build_tracker(scene.rig, TrackerConfig(threads=1), **subject).tracker


def error_mm(result, points) -> float:
    return 1e3 * float(np.linalg.norm(result.markers_m - points, axis=1).mean())


def nobody(seen) -> dict[str, Observation]:
    """The same views without a silhouette."""
    return {
        name: Observation.from_mask(name, 0, np.zeros_like(view.mask, np.uint8), view.edges)
        for name, view in seen.items()
    }


def test_a_walking_person_is_found_and_tracked(walk) -> None:
    scene, taken = walk
    tracker = tracker_of(scene, stature=1.72)
    results = [tracker.step(seen, stamp) for stamp, seen, _ in taken]
    assert all(result.state is TrackState.TRACKING for result in results)
    assert error_mm(results[0], taken[0][2]) < 120.0
    assert error_mm(results[-1], taken[-1][2]) < 60.0
    assert heading_difference(heading(results[-1].markers_m), heading(taken[-1][2])) < 0.5


def test_who_leaves_during_a_start_is_forgotten(walk) -> None:
    scene, taken = walk
    tracker, other = tracker_of(scene), tracker_of(scene)
    (at, seen, _), (then, blank, _), (later, views, points) = taken[:3]
    tracker.step(seen, at)
    result = tracker.step(nobody(blank), then)
    assert result.state is TrackState.SEARCHING and result.pose is None
    result = tracker.step(views, later)
    np.testing.assert_array_equal(result.pose, other.step(views, later).pose)
    assert error_mm(result, points) < 120.0


def test_the_stature_need_not_be_known(walk) -> None:
    scene, taken = walk
    tracker = tracker_of(scene)
    results = [tracker.step(seen, stamp) for stamp, seen, _ in taken]
    assert error_mm(results[-1], taken[-1][2]) < 70.0
    body = tracker.body
    tall = {m: markers(b, b.neutral)[2, 2] for m, b in (("it", body), ("true", scene.body))}
    assert abs(tall["it"] - tall["true"]) < 0.10


def crossing(searcher, population):
    """The best pose of a population with crossed legs, and as it is."""
    best = population.poses[0]
    legs = in_each_others_place(searcher.body, best, "legs", searcher.limits)
    assert is_crossed(searcher.body, legs, "legs")
    poses, headings = np.array([legs, best]), population.headings[[0, 0]]
    return replace(population, poses=poses, costs=np.array([0.0, 0.1]), headings=headings)


def test_crossed_legs_of_the_search_give_way_to_uncrossed_ones(walk, monkeypatch) -> None:
    scene, taken = walk
    tracker = tracker_of(scene, stature=1.72)

    def exchanged(frame, population, generation):
        return crossing(frame._searcher, population)

    monkeypatch.setattr(FramePopulation, "with_exchanged_pairs", exchanged)
    for stamp, seen, _ in taken[6:8]:
        result = tracker.step(seen, stamp)
        assert not is_crossed(tracker.body, result.pose, "legs")

        def recombined(frame, population, generation, *, fraction):
            return crossing(frame._searcher, population)

        # From now on each frame's generation ends with crossed legs.
        monkeypatch.setattr(FramePopulation, "recombined", recombined)


def test_the_first_frame_keeps_the_heading_of_the_search(walk, monkeypatch) -> None:
    """Also if the best pose that is left without crossed legs faces the other way."""
    scene, taken = walk
    stamp, seen, points = taken[0]

    def reversed_first(own, frame, population, leading_of):
        best = population.poses[0]
        poses = np.array([opposite_heading(own.body).of(best), best])
        headings = population.headings[[0, 0]] + (np.pi, 0.0)
        return replace(population, poses=poses, costs=np.array([0.0, 0.1]), headings=headings)

    monkeypatch.setattr(f"{STARTER}.uncrossed", reversed_first)
    result = tracker_of(scene, stature=1.72).step(seen, stamp)
    assert heading_difference(heading(result.markers_m), heading(points)) < 0.5


def test_how_usual_the_limbs_are_counts_for_the_heading(walk, monkeypatch) -> None:
    """Limbs that are most unusual with the true heading let the opposite one lead."""
    scene, taken = walk
    true_rad = heading(taken[0][2])

    def prior(body, poses):
        right = [heading_difference(heading(markers(body, p)), true_rad) < 1.5 for p in poses]
        return np.where(right, 0.2, 0.0)

    monkeypatch.setattr("markerless_tracker.tracking.search.prior_costs", prior)
    tracker = tracker_of(scene, stature=1.72)
    results = [tracker.step(seen, stamp) for stamp, seen, _ in taken[:SETTLING_FRAMES]]
    assert heading_difference(heading(results[-1].markers_m), true_rad) > 2.5


def test_nobody_is_a_state_and_no_error(walk) -> None:
    scene, taken = walk
    tracker = tracker_of(scene, stature=1.72)
    stamp, seen, _ = taken[0]
    result = tracker.step(nobody(seen), stamp - 1)
    assert result.state is TrackState.SEARCHING
    assert result.pose is None and result.markers_m is None and not result.iou
    assert tracker.step(seen, stamp).state is TrackState.TRACKING


@pytest.mark.parametrize(
    "sure_fit, sure_gap, looks", [(0.5, -1.0, 0), (0.5, 2.0, 1), (1.0, -1.0, 1)]
)
def test_a_second_frame_is_searched_anew_only_in_doubt(
    walk, monkeypatch, sure_fit, sure_gap, looks
) -> None:
    scene, taken = walk
    searched: list[int] = []
    monkeypatch.setattr(f"{STARTER}._SURE_FIT", sure_fit)
    monkeypatch.setattr(f"{STARTER}._SURE_GAP", sure_gap)
    monkeypatch.setattr(
        f"{STARTER}.Starter._second_search",
        lambda _, frame, population, seen: searched.append(1) or population,
    )
    tracker = tracker_of(scene, stature=1.72)
    for stamp, seen, _ in taken[:3]:
        tracker.step(seen, stamp)
    assert len(searched) == looks


def test_the_same_again_after_a_reset(walk) -> None:
    scene, taken = walk
    tracker = tracker_of(scene, stature=1.72)
    first = [tracker.step(seen, stamp).pose for stamp, seen, _ in taken[:2]]
    tracker.reset()
    assert tracker.state is TrackState.SEARCHING
    second = [tracker.step(seen, stamp).pose for stamp, seen, _ in taken[:2]]
    np.testing.assert_array_equal(first, second)


def test_warming_up_leaves_it_looking(walk) -> None:
    scene, _ = walk
    tracker = tracker_of(scene, stature=1.72)
    tracker.warm_up()
    assert tracker.state is TrackState.SEARCHING
    assert tracker.body.lengths_m == tracker_of(scene, stature=1.72).body.lengths_m


def test_how_long_somebody_is_in_view_counts_while_the_hull_waits(walk, monkeypatch) -> None:
    scene, taken = walk
    looked: list[int] = []
    searched: list[int] = []
    monkeypatch.setattr(
        f"{STARTER}.InViewGate.enough", lambda *arguments: looked.append(arguments[-1]) or True
    )
    monkeypatch.setattr(
        f"{STARTER}.Starter._search", lambda *arguments: searched.append(arguments[-1])
    )
    tracker = tracker_of(scene, stature=1.72)
    stamps = [stamp for stamp, _, _ in taken[:6]]
    for stamp, seen, _ in taken[:6]:
        tracker.step(seen, stamp)
    assert sorted(set(looked)) == stamps
    assert set(searched) < set(stamps)


def test_a_given_shape_is_not_fitted_again(walk, tmp_path) -> None:
    from markerless_tracker.body import Subject, write_subject

    scene, taken = walk
    shapes = dict(zip(scene.body.cone_names, scene.body.cone_shape, strict=True))
    write_subject(tmp_path / "me.yaml", Subject("me", dict(scene.body.lengths_m), shapes))
    tracker = tracker_of(scene, subject_file=tmp_path / "me.yaml")
    results = [tracker.step(seen, stamp) for stamp, seen, _ in taken]
    np.testing.assert_array_equal(tracker.body.cone_shape, scene.body.cone_shape)
    assert error_mm(results[-1], taken[-1][2]) < 25.0


def blind(seen):
    """The views of cameras that the light dazzles."""
    return {
        name: Observation.from_mask(
            name, 0, np.ones((view.height, view.width), np.uint8), view.edges
        )
        for name, view in seen.items()
    }


def test_a_person_lost_sight_of_is_found_again_elsewhere(walk, take_frames) -> None:
    """Blind for a quarter of a second, then the person stands half a metre further on."""
    scene, taken = walk
    tracker = tracker_of(scene, stature=1.72)
    for stamp, seen, _ in taken:
        tracker.step(seen, stamp)
    body, stamp = tracker.body, taken[-1][0]
    states = []
    for _ in range(15):
        stamp += 16_666_667
        result = tracker.step(blind(taken[-1][1]), stamp)
        assert result.pose is None
        states.append(result.state)
    assert states[0] is TrackState.LOST and states[-1] is TrackState.SEARCHING
    ((_, seen, points),) = take_frames(scene, [60])
    assert np.linalg.norm(points[0] - taken[-1][2][0]) > 0.5
    result = tracker.step(seen, stamp + 16_666_667)
    assert result.state is TrackState.TRACKING
    assert error_mm(result, points) < 80.0
    assert tracker.body is body


def test_some_blind_cameras_are_left_out_and_said(walk) -> None:
    scene, taken = walk
    tracker = tracker_of(scene, stature=1.72)
    for stamp, seen, _ in taken[:-1]:
        tracker.step(seen, stamp)
    stamp, seen, points = taken[-1]
    result = tracker.step({**seen, "cam01": blind(seen)["cam01"]}, stamp)
    assert "cam01" not in result.iou and error_mm(result, points) < 60.0
    assert any(w.startswith("cam01: left out") for w in result.warnings)


def test_who_walks_on_during_the_first_search_is_found_again(take_frames) -> None:
    """Live the first search takes the time of some dozen sets."""
    scene = SyntheticScene(body="person31", motion="walk", size_px=(328, 245), seed=2)
    tracker = tracker_of(scene)
    for stamp, seen, true in take_frames(scene, (0, 1, 28, 30, 32, 34, 36, 38, 40, 42)):
        result = tracker.step(seen, stamp)
        assert result.state is TrackState.TRACKING
        assert error_mm(result, true) < 120.0
        assert heading_difference(heading(result.markers_m), heading(true)) < 0.5
    moved_m = np.linalg.norm(scene.markers(28) - scene.markers(1), axis=1).mean()
    assert moved_m > 0.3


def test_after_a_gap_the_start_goes_on_at_the_person_not_at_a_larger_object(
    walk, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene, taken = walk
    tracker = tracker_of(scene)
    first, later = taken[0], taken[2]
    assert tracker.step(first[1], first[0]).state is TrackState.TRACKING

    def with_object(cameras, observed):
        """A large object 3 m away, then the person."""
        person = next(find_hulls(cameras, observed))
        points = np.concatenate([person.points_m] * 3) + [3.0, 0.0, 0.0]
        yield replace(person, points_m=points, trunk_m=person.trunk_m + [3.0, 0.0, 0.0])
        yield person

    monkeypatch.setattr(f"{STARTER}.find_hulls", with_object)
    result = tracker.step(later[1], first[0] + 2 * GAP_NS)
    assert result.state is TrackState.TRACKING and error_mm(result, later[2]) < 120.0
