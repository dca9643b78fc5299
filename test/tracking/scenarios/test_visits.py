"""A person walks in, is tracked, leaves and comes back elsewhere: from images to poses."""

from itertools import groupby

import numpy as np
import pytest

from markerless_tracker.body import markers
from markerless_tracker.geometry import FloatArray
from markerless_tracker.imaging import learn_background
from markerless_tracker.records import TrackState
from markerless_tracker.synthesis import SyntheticScene
from markerless_tracker.tracking import TrackerConfig, build_tracker

FPS = 30.0
WALK_M_S = 1.5
BEFORE, FIRST, BETWEEN, SECOND = range(2), range(2, 28), range(28, 34), range(34, 44)
"""Frames: empty, a person walks in until all see them, empty, the person on the other side."""
FIRST_TO_MIDDLE, SECOND_TO_MIDDLE = 52, 20
"""Frames from the first of a visit to the middle of the room."""


class Visits(SyntheticScene):
    """A room into which a person walks from one side, and then from another."""

    def pose(self, index: int) -> FloatArray:
        """Pose (p,) of a frame of one of the visits."""
        first = index in FIRST
        visit, left = (FIRST, FIRST_TO_MIDDLE) if first else (SECOND, SECOND_TO_MIDDLE)
        heading = 0.4 if first else 2.7
        away_m = (left - (index - visit.start)) / self.fps * WALK_M_S
        pose = super().pose(index).copy()
        tx, ty, rz = (self.body.index(f"pelvis_{name}") for name in ("tx", "ty", "rz"))
        pose[tx], pose[ty] = -away_m * np.cos(heading), -away_m * np.sin(heading)
        pose[rz] = heading
        return pose


@pytest.fixture(scope="module")
def visits():
    """Results and, where a person is there, the true markers: one per frame."""
    # In smaller images forearms are under 4 px wide, and the opening of silhouettes removes them.
    scene = Visits(
        body="person31", motion="walk", size_px=(246, 183), fps=FPS, samples=2, noise=4.0, seed=2
    )
    config = TrackerConfig(threads=1)
    backgrounds = {name: learn_background(f, config) for name, f in scene.backgrounds(6).items()}
    tracker = build_tracker(scene.rig, config, backgrounds=backgrounds, stature=1.72).tracker
    empty = {name: images[6:] for name, images in scene.backgrounds(6 + SECOND.start).items()}
    results, truth = [], []
    for index in range(SECOND.stop):
        there = index in FIRST or index in SECOND
        images = (
            scene.frame(index)[0]
            if there
            else {name: images[index] for name, images in empty.items()}
        )
        results.append(tracker.step(images, scene.stamp_ns(index)))
        truth.append(markers(scene.body, scene.pose(index)) if there else None)
    return results, truth


def test_each_state_follows_the_other_once(visits) -> None:
    results, _ = visits
    states = [state for state, _ in groupby(result.state for result in results)]
    assert states == [
        TrackState.SEARCHING, TrackState.TRACKING, TrackState.LOST, TrackState.SEARCHING,
        TrackState.TRACKING,
    ]  # fmt: skip
    assert results[BETWEEN.start].state is TrackState.LOST
    assert results[BETWEEN.stop - 1].state is TrackState.SEARCHING
    assert results[SECOND.start].state is TrackState.TRACKING


def test_nobody_has_a_pose(visits) -> None:
    results, truth = visits
    for result, true in zip(results, truth, strict=True):
        assert result.pose is None or true is not None
        assert (result.pose is None) == (result.state is not TrackState.TRACKING)


def test_nobody_is_no_fault_of_the_cameras(visits) -> None:
    results, _ = visits
    for index in (*BEFORE, *BETWEEN):
        assert results[index].warnings == ()


def test_he_is_tracked_where_he_is(visits) -> None:
    results, truth = visits

    def error_mm(index: int) -> float:
        return 1e3 * float(np.linalg.norm(results[index].markers_m - truth[index], axis=1).mean())

    tracked = [index for index in FIRST if results[index].pose is not None]
    # At first one camera sees the person and another half of the body: that is no start.
    assert FIRST[4] < tracked[0] < FIRST[-8]
    assert max(error_mm(index) for index in (*tracked, *SECOND)) < 70.0
    apart_m = np.linalg.norm(truth[FIRST[-1]][0] - truth[SECOND[0]][0])
    assert apart_m > 1.0
