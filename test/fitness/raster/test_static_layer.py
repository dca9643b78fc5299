"""Static layer and early termination: the same numbers."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from markerless_tracker.fitness import EDGE_RULES, Fitness
from markerless_tracker.fitness.raster.kernels import evaluate as evaluate_some
from markerless_tracker.optim import Problem, Sppso
from markerless_tracker.records import Comparison

PARTS = ("root", "torso_head", "l_arm", "r_leg")


def of_part(body, active, centre, *, edge_weight: float) -> Comparison:
    whole = Comparison.whole(centre, len(body.cone_names), edge_weight=edge_weight)
    return replace(whole, active=active)


@pytest.fixture(scope="module")
def scene(twin, smooth_edges, make_observation, make_pose):
    def make(body, cameras, seed: int):
        pose = make_pose(body, np.random.default_rng(seed), spread_m=0.3)
        seen = pose.copy()
        seen[body.root[3:]] += [0.05, -0.02, 0.03]
        return pose, {
            c.name: make_observation(c, twin(body, c, seen).silhouette(), smooth_edges(c, i + seed))
            for i, c in enumerate(cameras)
        }

    return make


@pytest.mark.parametrize("lens", [False, True], ids=["pinhole", "lens"])
@pytest.mark.parametrize("rule", EDGE_RULES)
@pytest.mark.parametrize("part", PARTS)
def test_a_part_costs_what_the_whole_body_costs(
    scene, elliptic_body, rig, lens_rig, rule, part, lens
):
    body, cameras = elliptic_body, (lens_rig if lens else rig).cameras
    pose, seen = scene(body, cameras, 3)
    fitness = Fitness(body, cameras, edge_rule=rule, edge_spacing_px=2.0)
    views = fitness.lay_out(seen)
    active = body.subspaces[part]
    rng = np.random.default_rng(1)
    points = pose[active] + 3.0 * body.sigma[active] * rng.standard_normal((12, active.size))
    for weight in (0.0, 1.0):
        partly = fitness.prepare(views, of_part(body, active, pose, edge_weight=weight))
        everything = np.arange(body.size)
        whole = fitness.prepare(views, of_part(body, everything, pose, edge_weight=weight))
        np.testing.assert_array_equal(partly(points), whole(partly.poses(points)))


def test_only_moving_parts_are_drawn_for_every_pose(scene, body, rig):
    pose, seen = scene(body, rig.cameras, 4)
    fitness = Fitness(body, rig.cameras, edge_rule="outline")
    views = fitness.lay_out(seen)

    def drawn(active) -> int:
        comparison = of_part(body, active, pose, edge_weight=1.0)
        return fitness.prepare(views, comparison).objective.silhouette_cones.size

    assert drawn(body.subspaces["l_arm"]) == 2
    assert drawn(body.root) == drawn(np.arange(body.size)) == len(body.cone_names)


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 2**32 - 1), st.sampled_from(PARTS), st.floats(0.0, 1.0))
def test_a_cost_below_its_cutoff_is_exact_and_above_it_a_bound(
    scene, body, rig, seed, part, edge_weight
):
    pose, seen = scene(body, rig.cameras, 5)
    fitness = Fitness(body, rig.cameras)
    active = body.subspaces[part]
    comparison = of_part(body, active, pose, edge_weight=edge_weight)
    evaluate = fitness.prepare(fitness.lay_out(seen), comparison)
    rng = np.random.default_rng(seed)
    points = pose[active] + 2.0 * body.sigma[active] * rng.standard_normal((15, active.size))
    full = evaluate(points)
    cutoff_costs = rng.permutation(full) + rng.choice([0.0, -np.inf, np.inf, 1e-12, -1e-12], 15)
    found = evaluate(points, cutoff_costs)
    wins = full < cutoff_costs
    np.testing.assert_array_equal(found[wins], full[wins])
    assert (found[~wins] >= cutoff_costs[~wins]).all()
    assert (found[~wins] <= full[~wins]).all()


def test_points_that_are_not_finite_cost_nan_at_any_cutoff(scene, body, rig):
    pose, seen = scene(body, rig.cameras, 6)
    fitness = Fitness(body, rig.cameras)
    evaluate = fitness.prepare(
        fitness.lay_out(seen), of_part(body, body.root, pose, edge_weight=0.0)
    )
    points = np.tile(pose[body.root], (3, 1))
    points[1, 2] = np.nan
    costs = evaluate(points, np.array([np.inf, -np.inf, np.inf]))
    assert np.isnan(costs[1]) and np.isfinite(costs[[0, 2]]).all()


@pytest.mark.parametrize("part", [*PARTS, "everything"])
def test_a_swarm_that_stops_evaluations_early_finds_the_same(scene, body, rig, part):
    pose, seen = scene(body, rig.cameras, 7)
    fitness = Fitness(body, rig.cameras)
    views = fitness.lay_out(seen)
    active = np.arange(body.size) if part == "everything" else body.subspaces[part]
    comparison = of_part(body, active, pose, edge_weight=0.5)

    def found(early: bool):
        optimizer = Sppso(
            Problem(
                bounds=body.limits[:, active], centre=pose[active], sigma=body.sigma[active],
                particles=10, iterations=12,
                # Every third point breaks a constraint.
                feasible=lambda points: np.arange(len(points)) % 3 > 0,
                rng=np.random.default_rng(0),
            )
        )  # fmt: skip
        best = optimizer.run(fitness.prepare(views, comparison), early=early)
        return best, optimizer.best_cost, optimizer.evaluations, optimizer._swarm.best_costs

    for ours, theirs in zip(found(True), found(False), strict=True):
        np.testing.assert_array_equal(ours, theirs)


def test_early_termination_saves_views(scene, body, rig):
    pose, seen = scene(body, rig.cameras, 8)
    fitness = Fitness(body, rig.cameras)
    views = fitness.lay_out(seen)
    evaluate = fitness.prepare(views, of_part(body, body.root, pose, edge_weight=0.0))
    point = pose[body.root] + 3.0
    assert 0.0 < evaluate(point[None])[0] <= 1.0
    # No view is drawn for particles that cannot win.
    untouched = np.full((1, len(views.names), 4), -7.0)
    costs = np.empty(1)
    evaluate_some(
        point[None].copy(), np.array([-np.inf]), evaluate.objective, untouched, costs, 0, 1
    )  # fmt: skip
    assert (untouched == -7.0).all()
