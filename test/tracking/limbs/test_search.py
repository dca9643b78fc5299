"""A limb is found where the evidence that was decided for a wrong pose speaks against it."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from markerless_tracker.body import MARKER_NAMES, markers
from markerless_tracker.camera import project_camera
from markerless_tracker.optim import keyed_generator
from markerless_tracker.records import Observation
from markerless_tracker.tracking import TrackerConfig
from markerless_tracker.tracking.candidates.own_evidence import OwnEvidence
from markerless_tracker.tracking.candidates.population import FramePopulation
from markerless_tracker.tracking.candidates.prior_costs import prior_costs
from markerless_tracker.tracking.candidates.recombination import Recombiner
from markerless_tracker.tracking.evidence.undecided import decide
from markerless_tracker.tracking.limbs import search as search_module
from markerless_tracker.tracking.limbs.rivals import rival_of
from markerless_tracker.tracking.limbs.search import (
    ARMS_SHARE,
    CLOSE,
    LimbSearch,
    best_refined,
    drawn_limbs,
)
from markerless_tracker.tracking.search import Searcher

SEARCH = "markerless_tracker.tracking.limbs.search"
ANKLE = MARKER_NAMES.index("LAnkle")
ANKLES = [ANKLE, MARKER_NAMES.index("RAnkle")]


def elsewhere(search: LimbSearch, limb, key: str) -> bool:
    """Search a limb in one frame."""
    return search.take_drawn(limb, search.drawn(limb, keyed_generator(0, 0, key), None))


def found_at(monkeypatch, other, cost) -> None:
    """Let the searches find a pose (p,)."""
    monkeypatch.setattr(
        f"{SEARCH}.drawn_limbs", lambda _f, _r, _p, limb, *_, **__: other[None, limb]
    )
    monkeypatch.setattr(f"{SEARCH}.best_refined", lambda *_: (other, cost))


@pytest.fixture(scope="module")
def bent(bent_leg):
    """A stander whose left leg was tracked bent, onto undecided pixels; some of the leg is, too."""
    scene, masks, pose, wrong, covered = bent_leg(-0.8, 0.6)
    seen = {}
    for name, mask in masks.items():
        trousers = mask & ~covered[name]
        trousers[::2] = False
        undecided = (covered[name] & ~mask) | trousers
        edges = np.zeros(mask.shape, np.uint8)
        seen[name] = Observation.from_mask(name, 0, mask & ~undecided, edges, undecided=undecided)
    body, config = scene.body, TrackerConfig(threads=1)
    searcher = Searcher(scene.rig, body, config, limits=body.limits, threads=1)
    return searcher, seen, pose, wrong


def test_a_leg_that_decided_its_evidence_is_found_elsewhere(bent) -> None:
    searcher, seen, true, wrong = bent
    body = searcher.body
    frame = FramePopulation(searcher, decide(seen, searcher.cameras, body, wrong), 0, wrong)
    own = OwnEvidence(searcher, seen, 0, frame)
    costs = frame.costs(np.array([true, wrong]))
    assert costs[0] > costs[1] + CLOSE
    assert own.cost_with_prior(true) < own.cost_with_prior(wrong)
    search = LimbSearch(Recombiner(body, searcher.limits), frame, own, wrong, 0.003)
    leg = body.subspaces["l_leg"]
    assert any(elsewhere(search, leg, f"{i}") for i in range(8))
    off_m = np.linalg.norm(markers(body, search.pose) - markers(body, true), axis=1)[ANKLE]
    assert off_m < 0.1 < np.linalg.norm(markers(body, wrong) - markers(body, true), axis=1)[ANKLE]


def test_a_leg_in_its_place_stays(bent) -> None:
    searcher, seen, true, _ = bent
    body = searcher.body
    frame = FramePopulation(searcher, decide(seen, searcher.cameras, body, true), 0, true)
    own = OwnEvidence(searcher, seen, 0, frame)
    search = LimbSearch(Recombiner(body, searcher.limits), frame, own, true, 0.003)
    for name in body.limbs:
        assert not elsewhere(search, body.subspaces[name], name)
    assert search.pose is true


@pytest.mark.parametrize("knee_rad, taken", [(0.4, False), (0.0, True)])
def test_what_the_rest_of_the_body_gains_is_no_merit_of_a_limb(
    bent_leg, monkeypatch, knee_rad, taken
) -> None:
    scene, masks, pose, _, _ = bent_leg(-0.8, 0.6)
    seen = {
        name: Observation.from_mask(name, 0, mask, np.zeros(mask.shape, np.uint8))
        for name, mask in masks.items()
    }
    body, config = scene.body, TrackerConfig(threads=1)
    searcher = Searcher(scene.rig, body, config, limits=body.limits, threads=1)
    frame = FramePopulation(searcher, seen, 0, pose)
    leg, knee = body.subspaces["l_leg"], body.index("l_knee")
    # The whole body lies beside the person; the leg is right, or wrong by more than the other's.
    estimate = pose.copy()
    estimate[body.index("pelvis_tx")] += 0.04
    estimate[knee] += 1.2 if taken else 0.0
    other = pose.copy()
    other[knee] += knee_rad
    costs = frame.costs(np.array([estimate, other]))
    assert costs[1] < costs[0] - 0.003
    found_at(monkeypatch, other, float(costs[1]))
    own = OwnEvidence(searcher, seen, 0, frame)
    search = LimbSearch(Recombiner(body, searcher.limits), frame, own, estimate, 0.003)
    assert elsewhere(search, leg, "leg") is taken


@pytest.mark.parametrize(
    "evidence, prior, moved_m, taken",
    [(0.0, 0.006, 0.35, True), (-0.0025, 0.006, 0.35, False), (-0.001, 0.005, 0.1, True),
     (0.004, 0.006, 1.0, False), (0.006, 0.0, 1.0, True)],
)  # fmt: skip
@pytest.mark.parametrize("undecided", [False, True])
def test_the_prior_moves_a_limb_only_where_the_evidence_allows_it(
    bent, monkeypatch, evidence, prior, moved_m, taken, undecided
) -> None:
    """The farther the limb is from its place, the more the evidence itself must gain."""
    body, estimate, other = bent[0].body, bent[2], bent[3]

    def priors(_, poses):
        return np.where((poses == other).all(axis=1), 0.0, prior)

    def costs(poses):
        return priors(body, poses) + np.where((poses == other).all(axis=1), 0.2 - evidence, 0.2)

    frame = SimpleNamespace(costs_with_prior=costs, refined=lambda poses, *_: poses)
    own = SimpleNamespace(
        undecided=frame, differs=undecided, body=body,
        refined=lambda pose, *_: pose,
        gain=lambda pose, other, **_: costs(pose[None])[0] - costs(other[None])[0],
    )  # fmt: skip
    monkeypatch.setattr(f"{SEARCH}.prior_costs", priors)
    monkeypatch.setattr(f"{SEARCH}.distance_m", lambda *_: moved_m)
    found_at(monkeypatch, other, costs(other[None])[0])
    search = LimbSearch(Recombiner(body, body.limits), frame, own, estimate, 0.001)
    leg = body.subspaces["l_leg"]
    assert bool(elsewhere(search, leg, "leg")) is taken
    assert search.pose is (other if taken else estimate)
    # The place that was not taken is the rival.
    gain, moved = evidence + prior, other - estimate
    expected = rival_of(body, estimate, other, gain if taken else -gain)
    assert search.rival is not None and expected is not None
    np.testing.assert_array_equal(search.rival.moved, -moved if taken else moved)
    assert search.rival.probability == pytest.approx(expected.probability)


def test_the_other_evidence_counts_for_arms_alone(bent, monkeypatch) -> None:
    body, estimate, other = bent[0].body, bent[2], bent[3]
    shares: list[float] = []
    frame = SimpleNamespace(
        costs_with_prior=lambda poses: np.zeros(len(poses)), refined=lambda poses, *_: poses
    )
    own = SimpleNamespace(
        undecided=frame, differs=True, body=body, refined=lambda pose, *_: pose,
        gain=lambda *_, other_share: shares.append(other_share) or 0.1,
    )  # fmt: skip
    found_at(monkeypatch, other, 0.0)
    for name in body.limbs:
        search = LimbSearch(Recombiner(body, body.limits), frame, own, estimate, 0.001)
        assert elsewhere(search, body.subspaces[name], name)
        assert shares == ([ARMS_SHARE] * 2 if name.endswith("arm") else [0.0] * 2)
        shares.clear()


@pytest.mark.parametrize("thorough", [True, False])
def test_a_draw_where_the_limb_is_is_not_refined(bent, monkeypatch, thorough) -> None:
    searcher, seen, true, wrong = bent
    body = searcher.body
    frame = FramePopulation(searcher, decide(seen, searcher.cameras, body, true), 0, true)
    monkeypatch.setattr(f"{SEARCH}.DRAWS", 4)
    monkeypatch.setattr(Recombiner, "with_prior_limb", lambda _, at, limb, n, rng: drawn)
    monkeypatch.setattr(Recombiner, "with_limb", lambda _, at, limb, n, rng: drawn)
    monkeypatch.setattr(Recombiner, "with_limb_near", lambda _, at, limb, f, rng: at.copy())
    for knee_rad, count in ((0.1, 0), (0.5, 1)):
        drawn = np.tile(true, (2, 1))
        drawn[:, body.index("l_knee")] += knee_rad
        limb = body.subspaces["l_leg"]
        rng = keyed_generator(0, 0, "leg")
        found = drawn_limbs(
            frame, Recombiner(body, searcher.limits), true, limb, rng, thorough=thorough
        )
        assert found.shape == (count, limb.size)


@pytest.mark.parametrize("thorough", [True, False])
def test_with_time_worse_draws_elsewhere_are_refined(bent, monkeypatch, thorough) -> None:
    """Where the limb is, a draw costs less than any draw elsewhere that is not refined."""
    searcher, seen, true, _ = bent
    body = searcher.body
    frame = FramePopulation(searcher, decide(seen, searcher.cameras, body, true), 0, true)
    drawn = np.tile(true, (2, 1))
    drawn[1, body.index("l_knee")] += 0.5
    monkeypatch.setattr(f"{SEARCH}.DRAWS", 4)
    monkeypatch.setattr(Recombiner, "with_prior_limb", lambda _, at, limb, n, rng: drawn)
    monkeypatch.setattr(Recombiner, "with_limb", lambda _, at, limb, n, rng: drawn)
    monkeypatch.setattr(Recombiner, "with_limb_near", lambda _, at, limb, f, rng: at.copy())
    limb, rng = body.subspaces["l_leg"], keyed_generator(0, 0, "leg")
    recombiner, cost = Recombiner(body, searcher.limits), float(frame.costs(true[None])[0])
    assert cost < frame.costs(drawn[1:])[0]
    monkeypatch.setattr(f"{SEARCH}.HOPELESS", 9.0)
    found = drawn_limbs(frame, recombiner, true, limb, rng, None, cost, thorough=thorough)
    np.testing.assert_array_equal(found, drawn[1:, limb] if thorough else np.empty((0, limb.size)))


def test_poses_are_compared_with_the_prior_of_their_limbs(bent, monkeypatch) -> None:
    searcher, seen, true, _ = bent
    frame = FramePopulation(searcher, seen, 0, true)
    own = OwnEvidence(searcher, seen, 0, frame)
    prior = 0.0
    monkeypatch.setattr(
        "markerless_tracker.tracking.search.prior_costs",
        lambda body, poses: np.full(len(poses), prior),
    )
    plain = own.cost_with_prior(true)
    prior = 0.25
    assert own.cost_with_prior(true) == pytest.approx(plain + 0.25)
    assert frame.total_costs(true[None])[0] >= frame.costs(true[None])[0] + 0.25


@pytest.mark.parametrize(("floor_sd_m", "found"), [(0.03, True), (0.0, False)])
def test_legs_of_which_little_shows_are_found_on_the_floor(bent_leg, floor_sd_m, found) -> None:
    """Trousers with stripes of the floor's colour: one leg alone hardly explains more there."""
    scene, masks, standing, _, _ = bent_leg(0.0, 0.0)
    body = scene.body
    folded = standing.copy()
    for side in "lr":
        folded[[body.index(f"{side}_hip_y"), body.index(f"{side}_knee")]] = 2.0, 2.4
    pelvis_m = markers(body, standing)[[MARKER_NAMES.index("Pelvis")]]
    seen = {}
    for camera in scene.rig:
        mask = masks[camera.name].copy()
        rows = np.arange(len(mask))
        mask[(rows > project_camera(pelvis_m, camera)[0, 1]) & (rows % 3 > 0)] = False
        edges = np.zeros(mask.shape, np.uint8)
        seen[camera.name] = Observation.from_mask(camera.name, 0, mask, edges)
    config = TrackerConfig(threads=1, refine=replace(TrackerConfig().refine, floor_sd_m=floor_sd_m))
    searcher = Searcher(scene.rig, body, config, limits=body.limits, threads=1)
    frame = FramePopulation(searcher, seen, 0, folded)
    own = OwnEvidence(searcher, seen, 0, frame)
    search = LimbSearch(Recombiner(body, searcher.limits), frame, own, folded, 0.003)
    for number, name in enumerate(("l_leg", "r_leg") * 3):
        elsewhere(search, body.subspaces[name], f"search {number}")
    assert (markers(body, search.pose)[ANKLES, 2].max() < 0.3) == found


def test_the_best_draws_are_those_by_f_s_and_those_with_the_prior(bent) -> None:
    body, usual = bent[0].body, bent[0].body.prior_mean
    poses = np.tile(usual, (4, 1))
    elbow = body.index("l_elbow")
    poses[:, elbow] -= np.array([9.0, 0.0, 9.0, 0.0]) * body.prior_sd[elbow]
    # The prior of the first and the third: 10 units of 0.001.
    costs, priors = np.array([0.100, 0.105, 0.101, 0.108]), prior_costs(body, poses)
    assert list(search_module._best(costs, priors, 1)) == [0, 1]
    assert list(search_module._best(costs, priors, 2)) == [0, 2, 1, 3]
    assert list(search_module._best(costs, priors, 4)) == [0, 2, 1, 3]
    assert list(search_module._best(np.array([0.1, 0.05, 0.2, 0.3]), priors, 1)) == [1]


def test_a_limb_with_the_prior_is_refined_beside_the_best_one(bent, monkeypatch) -> None:
    """Of two draws the better one after refinement is returned, whichever was the best before."""
    searcher, seen, true, _ = bent
    body = searcher.body
    frame = FramePopulation(searcher, decide(seen, searcher.cameras, body, true), 0, true)
    knee, limb = body.index("l_knee"), body.subspaces["l_leg"]
    drawn = np.tile(true, (2, 1))
    drawn[:, knee] += (0.5, 0.8)
    monkeypatch.setattr(f"{SEARCH}.DRAWS", 4)
    monkeypatch.setattr(Recombiner, "with_prior_limb", lambda _, at, limb, n, rng: drawn)
    monkeypatch.setattr(Recombiner, "with_limb", lambda _, at, limb, n, rng: drawn)
    monkeypatch.setattr(Recombiner, "with_limb_near", lambda _, at, limb, f, rng: at.copy())
    monkeypatch.setattr(f"{SEARCH}._best", lambda costs, priors, count: np.array([0, 1]))
    monkeypatch.setattr(FramePopulation, "refined", lambda _, poses, *args: poses.copy())
    for better in (0, 1):
        costs = np.full(2, 0.2)
        costs[better] = 0.1
        monkeypatch.setattr(
            FramePopulation, "costs_with_prior", lambda _, poses, costs=costs: costs[: len(poses)]
        )
        rng = keyed_generator(0, 0, "leg")
        found = drawn_limbs(frame, Recombiner(body, searcher.limits), true, limb, rng)
        poses = np.tile(true, (len(found), 1))
        poses[:, limb] = found
        best, cost = best_refined(frame, poses)
        assert best[knee] == drawn[better, knee] and cost == 0.1
