"""Crossed legs of an automatic start give way to uncrossed ones that explain as much."""

import numpy as np
import pytest

from markerless_tracker.synthesis import SyntheticScene
from markerless_tracker.tracking import TrackerConfig
from markerless_tracker.tracking.candidates.crossed import in_each_others_place, is_crossed
from markerless_tracker.tracking.candidates.mirror import opposite_heading
from markerless_tracker.tracking.candidates.own_evidence import OwnEvidence
from markerless_tracker.tracking.candidates.population import FramePopulation, Population
from markerless_tracker.tracking.search import Searcher
from markerless_tracker.tracking.start.uncrossed import uncrossed


@pytest.fixture(scope="module")
def stride(take_frames):
    """A person in mid stride; the pose, and that with each leg in the other's place."""
    scene = SyntheticScene(body="person31", motion="walk", size_px=(328, 245), seed=3)
    pose, [(_, seen, _)] = scene.frame(12)[2], take_frames(scene, [12])
    body, config = scene.body, TrackerConfig(threads=1)
    searcher = Searcher(scene.rig, body, config, limits=body.limits, threads=1)
    frame = FramePopulation(searcher, seen, 0, pose)
    crossed = in_each_others_place(body, pose, "legs", searcher.limits)
    assert is_crossed(body, crossed, "legs") and not is_crossed(body, pose, "legs")
    return frame, OwnEvidence(searcher, seen, 0, frame), pose, crossed


def population_of(poses, headings_rad=None):
    """Poses in this order, whatever they cost."""
    headings = np.zeros(len(poses)) if headings_rad is None else np.array(headings_rad)
    return Population(np.array(poses), np.arange(float(len(poses))), headings)


def test_uncrossed_legs_take_the_place_of_crossed_ones(stride) -> None:
    frame, own, pose, crossed = stride
    found = uncrossed(own, frame, population_of([crossed, pose]), lambda poses: poses)
    assert len(found) == 1 and not is_crossed(own.body, found.poses[0], "legs")
    assert found.costs[0] <= frame.total_costs(crossed[None])[0]


def test_poses_with_the_opposite_heading_stay(stride) -> None:
    """Which heading is right is decided later."""
    frame, own, pose, crossed = stride
    turned = opposite_heading(own.body).of(crossed)
    found = uncrossed(
        own, frame, population_of([crossed, pose, turned], [0.0, 0.0, np.pi]),
        lambda poses: poses.facing(0.0),
    )  # fmt: skip
    assert len(found) == 2
    assert any(np.array_equal(turned, kept) for kept in found.poses)


def test_crossed_legs_that_explain_more_stay(stride, monkeypatch) -> None:
    frame, own, pose, crossed = stride
    population = population_of([crossed, pose])
    monkeypatch.setattr(OwnEvidence, "gain", lambda *_: -1e-6)
    assert uncrossed(own, frame, population, lambda poses: poses) is population


def test_only_a_pose_that_leads_and_is_crossed_is_compared(stride, monkeypatch) -> None:
    frame, own, pose, crossed = stride
    monkeypatch.setattr(OwnEvidence, "gain", None)
    for poses in ([pose, crossed], [crossed], [pose]):
        population = population_of(poses)
        assert uncrossed(own, frame, population, lambda poses: poses) is population
    population = population_of([crossed, pose])
    # The other pose has another heading.
    assert uncrossed(own, frame, population, lambda _: population_of([crossed])) is population
