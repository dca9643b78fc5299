"""Poses of a person in a wide coat, compared with sections that are fitted to each."""

from dataclasses import replace

import numpy as np
import pytest

from markerless_tracker.body import load_body, markers
from markerless_tracker.fitness.raster.silhouette import body_masks
from markerless_tracker.records import Observation
from markerless_tracker.synthesis import SyntheticScene, ring_rig
from markerless_tracker.tracking import TrackerConfig
from markerless_tracker.tracking.candidates.population import FramePopulation
from markerless_tracker.tracking.candidates.postures import postures
from markerless_tracker.tracking.search import Searcher, make_searcher
from markerless_tracker.tracking.start import own_sections
from markerless_tracker.tracking.start.own_sections import LEAST_GAIN, better_with_own_sections
from markerless_tracker.tracking.start.starter import Starter
from markerless_tracker.tracking.start.two_headings import MOST_FRAMES

BODY = load_body("person31", 1.75)
RIG = ring_rig(4, (328, 245))
COARSE = (8, (0.15, 0.05))


def searcher_for(body):
    return Searcher(RIG, body, TrackerConfig(threads=1), limits=body.limits, threads=1)


def in_a_coat():
    shape = BODY.cone_shape.copy()
    for cone, name in enumerate(BODY.cone_names):
        if name in ("pelvis", "belly", "chest"):
            shape[cone, :, :2] *= 1.5
    return replace(BODY, cone_shape=shape)


def seen_at(pose):
    return {
        name: Observation.from_mask(name, 0, mask, np.zeros(mask.shape, np.uint8))
        for name, mask in body_masks(in_a_coat(), pose, RIG).items()
    }


def off_m(pose, true):
    return float(np.linalg.norm(markers(BODY, pose) - markers(BODY, true), axis=1).max())


def test_arms_that_explain_the_coat_are_found_out() -> None:
    """With arms of all known postures: the best pose of the common body is kept if it is right."""
    arms, right, wrong = BODY.subspaces["arms"], 0, 0
    standing = BODY.neutral.copy()
    standing[BODY.index("pelvis_tz")] = 0.95
    poses = np.tile(standing, (len(postures(BODY)), 1))
    poses[:, arms] = postures(BODY)[:, arms]
    for true in poses:
        seen = seen_at(true)
        frame = FramePopulation(searcher_for(BODY), seen, 0, true)
        population = frame.selected(frame.refined(poses, *COARSE))
        first_m = off_m(population.poses[0], true)
        found = better_with_own_sections(population, BODY, searcher_for, seen, 0)
        if first_m < 0.10:
            right += 1
            assert found is None
        elif found is not None:
            wrong += 1
            assert off_m(found.pose, true) < min(0.2, 0.5 * first_m)
            assert found.cost < population.costs[0]
    assert right >= 4 and wrong >= 4


@pytest.mark.parametrize(
    "more_cost, gain, taken",
    [(0.0, LEAST_GAIN + 1e-6, True), (0.0, LEAST_GAIN - 1e-6, False), (0.02, 0.016, True),
     (0.02, 0.014, False), (0.03, 0.1, False)],
)  # fmt: skip
def test_what_a_pose_must_gain_grows_with_what_it_costs_more(
    monkeypatch, more_cost, gain, taken
) -> None:
    poses = np.stack([BODY.neutral, BODY.neutral + 0.01])
    seen = seen_at(BODY.neutral)
    population = FramePopulation(searcher_for(BODY), seen, 0, poses[0]).selected(poses[:1])
    population = replace(
        population, poses=poses, costs=np.array([0.1, 0.1 + more_cost]), headings=np.zeros(2)
    )
    costs = iter([0.08, 0.08 - gain])
    monkeypatch.setattr(
        own_sections, "_fitted",
        lambda pose, *_: own_sections.FittedPose(searcher_for(BODY), pose, next(costs)),
    )  # fmt: skip
    found = better_with_own_sections(population, BODY, searcher_for, seen, 0)
    assert (found is not None) is taken
    if found is not None:
        np.testing.assert_array_equal(found.pose, poses[1])


@pytest.mark.parametrize("fit_shape", [True, False])
def test_a_start_ends_with_the_better_pose_and_its_body(monkeypatch, fit_shape) -> None:
    """If sections are fitted at all."""
    scene = SyntheticScene(body="person31", motion="stand", size_px=(328, 245), seed=2)
    _, masks, _ = scene.frame(0)
    seen = {
        name: Observation.from_mask(name, 0, mask, np.zeros(mask.shape, np.uint8))
        for name, mask in masks.items()
    }
    taken = []

    def better(population, body, make, *_):
        pose = population.poses[0].copy()
        pose[body.index("l_elbow")] += 0.5
        taken.append(own_sections.FittedPose(make(replace(body, name="its own")), pose, 0.0))
        return taken[-1]

    monkeypatch.setattr(
        "markerless_tracker.tracking.start.settling.better_with_own_sections", better
    )
    searching = dict(rig=scene.rig, config=TrackerConfig(threads=1), threads=1)
    starter = Starter(
        scene.rig, BODY, lambda body: make_searcher(body, **searching),
        lambda observed, *_: (dict(observed), ()), fit_shape=fit_shape,
    )  # fmt: skip
    for number in range(MOST_FRAMES):
        start = starter.step(seen, number * 16_000_000)
        assert start is not None
        if start.settled or start.rest:
            break
    assert (start.rest is not None) is fit_shape
    start = start.rest() if start.rest else start
    assert start.settled
    assert len(taken) == fit_shape
    assert (start.searcher.body.name == "its own") is fit_shape
    if taken:
        np.testing.assert_array_equal(start.pose, taken[0].pose)
