"""Undecided pixels count neither way: against counts in NumPy."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from markerless_tracker.fitness import Fitness
from markerless_tracker.fitness.raster.silhouette import body_masks
from markerless_tracker.fitness.terms import OVERLAP, PROJECTED


def blots(shape, rng, count: int):
    """(h, w) rectangles of some size."""
    mask = np.zeros(shape, dtype=bool)
    for _ in range(count):
        v, u = rng.integers(0, shape[0]), rng.integers(0, shape[1])
        mask[v : v + rng.integers(5, 60), u : u + rng.integers(5, 60)] = True
    return mask


@pytest.fixture(scope="module")
def scene(twin, make_observation, make_pose):
    """`make(body, rig, seed)`: pose, and observations with undecided pixels in places."""

    def make(body, rig, seed: int):
        rng = np.random.default_rng(seed)
        pose = make_pose(body, rng, spread_m=0.3)
        observations = {}
        for camera in rig:
            person = twin(body, camera, pose).silhouette()
            undecided = blots(person.shape, rng, 12)
            seen = make_observation(camera, person)
            observations[camera.name] = seen.with_masks(person & ~undecided, undecided)
        return pose, observations

    return make


@settings(deadline=None, max_examples=10)
@given(st.integers(0, 2**32 - 1))
def test_counts_are_of_known_pixels(scene, body, rig, seed) -> None:
    pose, observations = scene(body, rig, seed)
    pose = pose + 0.5 * body.sigma * np.random.default_rng(seed).standard_normal(body.size)
    fitness = Fitness(body, rig.cameras)
    views = fitness.lay_out(observations)
    every = np.ones(len(body.cone_names), dtype=bool)
    counts = fitness.count(views, pose[None], every, every)[0]
    drawn = body_masks(body, pose, rig.cameras)
    for name, row, observed in zip(views.names, counts, views.arrays.observed, strict=True):
        mask, undecided = observations[name].mask, observations[name].undecided
        assert row[OVERLAP] == (drawn[name] & mask).sum()
        assert row[PROJECTED] == (drawn[name] & ~undecided).sum()
        assert observed == mask.sum()


def test_the_cost_does_not_depend_on_what_undecided_pixels_are(scene, body, rig) -> None:
    """A body that lies on the undecided pixels too is as good as one that is cut out there."""
    pose, observations = scene(body, rig, 1)
    fitness = Fitness(body, rig.cameras)
    terms = fitness.terms(fitness.lay_out(observations), pose)
    assert min(t.silhouette for t in terms.values()) > 0.97
    two = {name: seen.with_masks(seen.mask, None) for name, seen in observations.items()}
    terms = fitness.terms(fitness.lay_out(two), pose)
    assert max(t.silhouette for t in terms.values()) < 0.97


def test_nothing_known_is_defined(body, rig, pose, make_observation) -> None:
    blind = {}
    for camera in rig:
        nothing = np.zeros(camera.size_px[::-1], bool)
        blind[camera.name] = make_observation(camera, nothing).with_masks(nothing, ~nothing)
    fitness = Fitness(body, rig.cameras)
    for terms in fitness.terms(fitness.lay_out(blind), pose).values():
        assert np.isfinite([terms.silhouette, terms.overlap]).all()


@pytest.mark.parametrize("part", ["root", "torso_head", "l_arm", "r_leg"])
def test_a_part_costs_what_the_whole_body_costs(scene, body, rig, make_comparison, part) -> None:
    pose, observations = scene(body, rig, 2)
    fitness = Fitness(body, rig.cameras)
    views = fitness.lay_out(observations)
    active = body.subspaces[part]
    rng = np.random.default_rng(1)
    points = pose[active] + 2.0 * body.sigma[active] * rng.standard_normal((10, active.size))
    partly = fitness.prepare(views, make_comparison(body, pose, active=active, edge_weight=0.0))
    whole = fitness.prepare(views, make_comparison(body, pose, edge_weight=0.0))
    costs = partly(points)
    np.testing.assert_array_equal(costs, whole(partly.poses(points)))
    assert np.ptp(costs) > 0.0


def test_undecided_pixels_of_a_region_are_those_of_the_frame(scene, body, rig, pose) -> None:
    """Outside an observation's region everything is known background."""
    _, observations = scene(body, rig, 3)
    region = np.s_[40:200, 70:250]
    fitness = Fitness(body, rig.cameras)
    cut, whole = {}, {}
    for name, seen in observations.items():
        inside = np.zeros(seen.mask.shape, bool)
        inside[region] = True
        whole[name] = seen.with_masks(seen.mask & inside, seen.undecided & inside)
        cut[name] = type(seen).from_mask(
            name, 0, np.ascontiguousarray(seen.mask[region]),
            np.ascontiguousarray(seen.edges[region]),
            undecided=np.ascontiguousarray(seen.undecided[region]),
            size_px=seen.size_px, offset_px=(70, 40),
        )  # fmt: skip
    one, other = (fitness.terms(fitness.lay_out(views), pose) for views in (cut, whole))
    assert one == other
