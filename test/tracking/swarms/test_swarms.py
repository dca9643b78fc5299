"""Compiled swarms against the ones that are written in NumPy: the same draws, the same result."""

import numpy as np
import pytest

from markerless_tracker.body import Feasibility, load_body
from markerless_tracker.drawing import silhouette
from markerless_tracker.errors import SearchError
from markerless_tracker.fitness import Fitness
from markerless_tracker.optim import ALGORITHMS, Problem, keyed_generator
from markerless_tracker.records import Comparison, Observation
from markerless_tracker.synthesis import ring_rig
from markerless_tracker.tracking.swarms import SWARMS, SwarmSearch

BODY = load_body("balan31", 1.75)
RIG = ring_rig(2, (160, 120))
FITNESS = Fitness(BODY, RIG.cameras)
CASES = [
    ("sppso", {}),
    ("sppso", {"update": "particle"}),
    ("mcpso", {}),
    ("mcpso", {"sub_swarms": 5, "master_term": "weighted", "migration": 1.0}),
    ("pso", {}),
    ("pso", {"inertia_max": 1.0, "inertia_min": 0.3, "acceleration": 1.5}),
]


@pytest.fixture(scope="module")
def views():
    seen = {}
    pose = BODY.neutral.copy()
    pose[BODY.index("pelvis_tz")] = 0.95
    for camera in RIG:
        mask = silhouette(BODY, pose, camera)
        seen[camera.name] = Observation.from_mask(camera.name, 0, mask, np.zeros_like(mask, "u1"))
    return FITNESS.lay_out(seen)


def both(views, name, options, *, part="everything", particles=12, iterations=9, wide=1.0, seed=0):
    """What the compiled and the written swarm find."""
    active = np.arange(BODY.size) if part == "everything" else BODY.subspaces[part]
    # No joint is at its limit.
    pose = BODY.neutral.copy()
    pose[BODY.joints] += 0.2 * (BODY.limits[:, BODY.joints].mean(axis=0) - pose[BODY.joints])
    pose[BODY.index("pelvis_tz")] = 0.9
    comparison = Comparison(
        active, pose, 1.0, 0.0, *np.ones((2, len(BODY.cone_names)), dtype=np.bool_)
    )
    feasible = Feasibility(BODY, BODY.limits, "elliptic")
    evaluator = FITNESS.prepare(views, comparison)
    shared = {
        "centre": pose[active],
        "sigma": wide * BODY.sigma[active],
        "bounds": np.ascontiguousarray(BODY.limits[:, active]),
        "iterations": iterations,
    }
    found = SWARMS[name](
        SwarmSearch(
            **shared, count=particles, rng=keyed_generator(seed, 1, name),
            constraints=feasible.constraints(active, pose, forgive=True),
            objective=evaluator.objective,
        ),
        **options,
    )  # fmt: skip
    refused = []

    def noted(points):
        good = feasible.around(active, pose, forgive=True)(points)
        refused.append(int((~good).sum()))
        return good

    written = ALGORITHMS[name](
        Problem(
            **shared, particles=particles, rng=keyed_generator(seed, 1, name), feasible=noted
        ),
        **options,
    )  # fmt: skip
    written.run(evaluator, early=True)
    return found, written, sum(refused)


@pytest.mark.parametrize(("name", "options"), CASES)
@pytest.mark.parametrize("part", ["everything", "l_arm"])
@pytest.mark.parametrize("wide", [1.0, 40.0])
def test_they_find_the_same(views, name, options, part, wide) -> None:
    """Also where many moves break a constraint."""
    found, written, refused = both(views, name, options, part=part, wide=wide)
    np.testing.assert_array_equal(found.found, written.best_x)
    assert found.found_cost[0] == written.best_cost
    np.testing.assert_array_equal(found.best.std(axis=0), written.particle_sd)
    assert found.found_cost[0] < np.inf if wide == 1.0 else refused > 10 or part == "l_arm"


@pytest.mark.parametrize("name", sorted(SWARMS))
@pytest.mark.parametrize("iterations", [1, 2])
def test_few_iterations(views, name, iterations) -> None:
    found, written, _ = both(views, name, {}, iterations=iterations)
    np.testing.assert_array_equal(found.found, written.best_x)
    assert found.found_cost[0] == written.best_cost < np.inf


@pytest.mark.parametrize("name", sorted(SWARMS))
def test_another_seed_gives_another_result(views, name) -> None:
    one, other = (both(views, name, {}, seed=seed)[0].found for seed in (0, 1))
    assert (one != other).any()


@pytest.mark.parametrize("name", sorted(SWARMS))
def test_without_any_feasible_pose_the_centre_stays(views, name) -> None:
    active = np.arange(BODY.size)
    pose = BODY.neutral.copy()
    bounds = BODY.limits.copy()
    bounds[0, 8] = bounds[1, 8] = 5.0
    every = np.ones(len(BODY.cone_names), dtype=np.bool_)
    comparison = Comparison(active, pose, 1.0, 0.0, every, every)
    search = SwarmSearch(
        centre=pose.copy(), sigma=BODY.sigma.copy(), bounds=BODY.limits.copy(), count=8,
        iterations=3, rng=keyed_generator(0, 0, ""),
        constraints=Feasibility(BODY, bounds, "none").constraints(active, pose),
        objective=FITNESS.prepare(views, comparison).objective,
    )  # fmt: skip
    np.testing.assert_array_equal(SWARMS[name](search).found, pose)


@pytest.mark.parametrize(
    ("name", "options", "message"),
    [
        ("sppso", {"update": "never"}, "update is 'never'"),
        ("mcpso", {"master_term": "none"}, "master_term is 'none'"),
        ("mcpso", {"sub_swarms": 12}, "12 particles for 12 sub-swarms"),
        ("pso", {"inertia_min": 3.0}, "inertia_min is 3"),
    ],
)
def test_settings_are_refused(views, name, options, message) -> None:
    with pytest.raises(SearchError, match=message):
        both(views, name, options)
