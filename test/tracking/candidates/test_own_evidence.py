"""Poses compared each in the evidence that its body decides."""

from types import SimpleNamespace

import numpy as np
import pytest

from markerless_tracker.fitness.raster.silhouette import body_masks
from markerless_tracker.records import Observation
from markerless_tracker.tracking import TrackerConfig
from markerless_tracker.tracking.candidates.own_evidence import OwnEvidence
from markerless_tracker.tracking.candidates.population import FramePopulation
from markerless_tracker.tracking.evidence.undecided import decide
from markerless_tracker.tracking.search import Searcher


@pytest.fixture(scope="module")
def legs_undecided(bent_leg):
    """A person whose legs are undecided, with as much floor around them, and a bent left knee."""
    scene, masks, pose, wrong, covered = bent_leg(-0.5, 0.9)
    seen = {}
    for name, mask in masks.items():
        low = np.arange(len(mask))[:, None] > 0.6 * np.flatnonzero(mask.any(axis=1)).max()
        undecided = low & (mask | covered[name])
        edges = np.zeros(mask.shape, np.uint8)
        seen[name] = Observation.from_mask(name, 0, mask & ~undecided, edges, undecided=undecided)
    body, config = scene.body, TrackerConfig(threads=1)
    searcher = Searcher(scene.rig, body, config, limits=body.limits, threads=1)
    return searcher, seen, pose, wrong


@pytest.fixture(scope="module")
def arm_undecided(bent_leg):
    """A person whose raised left arm is undecided, and the same pose with that arm at the side."""
    scene, _, beside, _, _ = bent_leg(0.0, 0.0)
    body, cameras = scene.body, list(scene.rig)
    raised = beside.copy()
    raised[body.index("l_shoulder_x")] += 0.9
    masks, without = body_masks(body, raised, cameras), body_masks(body, beside, cameras)
    seen = {}
    for name, mask in masks.items():
        undecided, edges = mask & ~without[name], np.zeros(mask.shape, np.uint8)
        seen[name] = Observation.from_mask(name, 0, mask & ~undecided, edges, undecided=undecided)
    config = TrackerConfig(threads=1)
    searcher = Searcher(scene.rig, body, config, limits=body.limits, threads=1)
    return searcher, seen, raised, beside


def own_of(searcher, seen, at):
    decided = decide(seen, searcher.cameras, searcher.body, at)
    frame = FramePopulation(searcher, decided, 0, at)
    return frame, OwnEvidence(searcher, seen, 0, frame)


def test_evidence_decided_for_a_wrong_pose_speaks_against_the_true_one(legs_undecided) -> None:
    searcher, seen, true, wrong = legs_undecided
    frame, own = own_of(searcher, seen, wrong)
    assert own.differs
    shared = frame.costs(np.array([true, wrong]))
    assert shared[0] > shared[1]
    # A cost of its own does not depend on what was decided before.
    assert own.cost_with_prior(true) - own.cost_with_prior(wrong) < 0.5 * (shared[0] - shared[1])
    assert own.cost_with_prior(true) == own_of(searcher, seen, true)[1].cost_with_prior(true)


def test_undecided_pixels_count_for_no_pose(legs_undecided) -> None:
    searcher, seen, true, wrong = legs_undecided
    frame, own = own_of(searcher, seen, wrong)
    shared, apart = (
        frame.costs(np.array([true, wrong])),
        own.undecided.costs(np.array([true, wrong])),
    )
    assert abs(apart[0] - apart[1]) < 0.25 * (shared[0] - shared[1])
    same = own_of(searcher, seen, true)[1].undecided.costs(np.array([true, wrong]))
    np.testing.assert_array_equal(apart, same)


def test_a_pose_is_refined_in_its_own_evidence(legs_undecided) -> None:
    searcher, seen, true, wrong = legs_undecided
    _, own = own_of(searcher, seen, wrong)
    off = true.copy()
    off[:3] += 0.03
    found = own.refined(off, 6, (0.12, 0.035))
    assert own.cost_with_prior(found) < own.cost_with_prior(off)


@pytest.mark.parametrize("share", [0.0, 0.25, 1.0])
def test_a_gain_weighs_the_evidence_of_both_poses(legs_undecided, share) -> None:
    searcher, seen, true, wrong = legs_undecided
    _, own = own_of(searcher, seen, wrong)
    in_wrong, in_true = (
        own_of(searcher, seen, at)[0].costs_with_prior(np.array([wrong, true]))
        for at in (wrong, true)
    )
    cost_wrong = (1.0 - share) * in_wrong[0] + share * in_true[0]
    cost_true = (1.0 - share) * in_true[1] + share * in_wrong[1]
    gain = own.gain(wrong, true, other_share=share)
    assert gain == pytest.approx(cost_wrong - cost_true)
    assert own.gain(true, wrong, other_share=share) == pytest.approx(-gain)
    assert own.gain(true, true, other_share=share) == 0.0


def test_evidence_that_suits_both_poses_is_no_gain_of_the_one_that_decided_it(monkeypatch) -> None:
    """The evidence differs where the poses do not; figures of a frame of a recording."""
    here, there = np.array([0.0480, 0.0489]), np.array([0.0373, 0.0382])

    class Decided:
        def __init__(self, costs):
            self.costs = costs

        def costs_with_prior(self, poses):
            return self.costs

    own = OwnEvidence(SimpleNamespace(body=None), {}, 0, None)
    pose, other = np.zeros(1), np.ones(1)
    monkeypatch.setattr(own, "_decided", lambda at: Decided(there if at[0] else here))
    assert own.gain(pose, other) == pytest.approx(0.0373 - 0.0382)
    shared = 0.75 * (0.0373 - 0.0382) + 0.25 * (0.0373 - 0.0489)
    assert own.gain(pose, other, other_share=0.25) == pytest.approx(shared)


def test_a_pose_without_an_undecided_arm_misses_nothing_in_its_own_evidence(
    arm_undecided,
) -> None:
    """In the evidence of the other pose it misses the arm."""
    searcher, seen, raised, beside = arm_undecided
    _, own = own_of(searcher, seen, raised)
    alone = own.gain(raised, beside)
    assert alone > -0.01
    assert own.gain(raised, beside, other_share=0.5) < alone - 0.01


def test_the_evidence_of_a_pose_is_decided_once(legs_undecided, monkeypatch) -> None:
    searcher, seen, true, wrong = legs_undecided
    _, own = own_of(searcher, seen, wrong)
    poses = []

    def counted(imaged, cameras, body, pose):
        poses.append(pose)
        return decide(imaged, cameras, body, pose)

    monkeypatch.setattr("markerless_tracker.tracking.candidates.own_evidence.decide", counted)
    first = own.cost_with_prior(true)
    assert own.cost_with_prior(true.copy()) == first != own.cost_with_prior(wrong)
    assert len(poses) == 2
    own.gain(wrong, true, other_share=0.5)
    assert len(poses) == 2


def test_without_undecided_pixels_all_poses_share_the_evidence(legs_undecided) -> None:
    searcher, seen, true, wrong = legs_undecided
    two_classes = decide(seen, searcher.cameras, searcher.body, true)
    two_classes = {
        name: Observation.from_mask(name, 0, one.mask, one.edges)
        for name, one in two_classes.items()
    }
    frame, own = own_of(searcher, two_classes, true)
    assert not own.differs and own.undecided is frame
    assert own.cost_with_prior(wrong) == frame.costs_with_prior(wrong[None])[0]
