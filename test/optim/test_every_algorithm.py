"""What holds for every algorithm that is registered, whatever it does."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from markerless_tracker.optim import ALGORITHMS, Problem

NAMES = sorted(ALGORITHMS)
LOW, HIGH = 0.4, 3.0


def inside(points):
    """A box without a ball in it: bounds, and a constraint that is not one."""
    ball = np.linalg.norm(points - 1.0, axis=1) < 0.3
    return (points >= LOW).all(axis=1) & (points <= HIGH).all(axis=1) & ~ball


def problem(*, d=3, particles=12, iterations=8, seed=1, sigma=0.4, feasible=inside):
    return Problem(
        bounds=np.tile([[LOW], [HIGH]], (1, d)),
        centre=np.full(d, 1.6),
        sigma=np.full(d, sigma),
        particles=particles,
        iterations=iterations,
        feasible=feasible,
        rng=np.random.default_rng(seed),
    )


def sphere(points):
    return np.sum(points**2, axis=1)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(("particles", "iterations"), [(20, 30), (5, 1), (4, 2), (7, 11)])
def test_the_budget_is_spent_exactly(name, particles, iterations):
    evaluated = []
    search = ALGORITHMS[name](problem(particles=particles, iterations=iterations))
    search.run(lambda x: evaluated.append(len(x)) or sphere(x))
    assert sum(evaluated) == search.evaluations == particles * iterations
    assert search.finished


@pytest.mark.parametrize("name", NAMES)
@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), sigma=st.floats(0.01, 2.0))
def test_the_best_and_the_estimate_keep_bounds_and_constraints(name, seed, sigma):
    """The minimum lies outside of both."""
    search = ALGORITHMS[name](problem(seed=seed, sigma=sigma))
    estimate = search.run(sphere)
    assert inside(estimate[None])[0]
    assert inside(search.best_x[None])[0]
    if np.isfinite(search.best_cost):
        assert search.best_cost == sphere(search.best_x[None])[0]


@pytest.mark.parametrize("name", NAMES)
def test_it_gets_nearer_to_the_minimum(name):
    search = ALGORITHMS[name](problem(particles=40, iterations=20))
    estimate = search.run(lambda x: 20.0 * np.sum((x - [0.6, 1.9, 2.2]) ** 2, axis=1))
    assert (
        np.linalg.norm(estimate - [0.6, 1.9, 2.2])
        < 0.3
        < np.linalg.norm(search.problem.centre - [0.6, 1.9, 2.2])
    )


@pytest.mark.parametrize("name", NAMES)
def test_particles_scatter_less_where_costs_tell_them_where_to_be(name):
    """The first parameter decides the cost, the second does not matter at all."""
    search = ALGORITHMS[name](
        problem(d=2, particles=60, iterations=1 if name == "pf" else 6, sigma=0.3)
    )
    search.run(lambda x: 30.0 * (x[:, 0] - 1.8) ** 2)
    assert search.particle_sd.shape == (2,)
    assert 0.0 < search.particle_sd[0] < 0.7 * search.particle_sd[1]


@pytest.mark.parametrize("name", NAMES)
def test_the_same_seed_gives_the_same_bytes_and_another_another(name):
    """The minimum is inside: in a corner of the bounds two runs may end on the same point."""

    def off_the_corner(points):
        return sphere(points - 1.9)

    runs = [ALGORITHMS[name](problem(seed=s)).run(off_the_corner).tobytes() for s in (5, 5, 6)]
    assert runs[0] == runs[1] != runs[2]


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("bad", [np.nan, -np.inf, np.inf])
def test_a_cost_that_is_not_finite_never_wins(name, bad):
    """Where the sphere is small, the cost is bad: neither the best nor the estimate lies there."""

    def wanting(points):
        costs = sphere(points)
        costs[points[:, 0] < 1.5] = bad
        return costs

    search = ALGORITHMS[name](
        problem(particles=30), **({"estimate": "best"} if "pf" in name else {})
    )
    estimate = search.run(wanting)
    assert estimate[0] >= 1.5 and search.best_x[0] >= 1.5
    assert np.isfinite(search.best_cost)
    assert search.bad_costs > 0


@pytest.mark.parametrize("name", NAMES)
def test_nothing_but_bad_costs_leave_the_centre(name):
    search = ALGORITHMS[name](problem())
    np.testing.assert_array_equal(search.run(lambda x: np.full(len(x), np.nan)), np.full(3, 1.6))
    assert search.bad_costs == search.evaluations == 96


@pytest.mark.parametrize("name", NAMES)
def test_nothing_feasible_leaves_the_centre(name):
    search = ALGORITHMS[name](problem(feasible=lambda x: np.zeros(len(x), dtype=bool)))
    costs = []
    search.run(lambda x: costs.append(sphere(x)) or costs[-1])
    assert search.evaluations == 96
    assert np.isfinite(search.best_x).all() and np.isfinite(search.estimate).all()


@pytest.mark.parametrize("name", NAMES)
def test_the_best_never_gets_worse_and_is_the_least_of_what_may_win(name):
    search = ALGORITHMS[name](problem())
    best = np.inf
    while not search.finished:
        points = search.ask()
        costs = sphere(points)
        allowed = inside(points)
        search.tell(costs)
        if allowed.any():
            best = min(best, costs[allowed].min())
        assert search.best_cost == best


@pytest.mark.parametrize("name", NAMES)
def test_a_parameter_without_spread_stays(name):
    fixed = problem()
    fixed.sigma[1] = 0.0
    np.testing.assert_allclose(ALGORITHMS[name](fixed).run(sphere)[1], 1.6, rtol=1e-14)


@pytest.mark.parametrize("name", NAMES)
def test_what_it_remembers_fits_the_next_search(name):
    first = ALGORITHMS[name](problem())
    first.run(sphere)
    assert (first.memory is not None) == (name in ("apf", "pf"))
    again = problem(seed=2)
    following = ALGORITHMS[name](
        Problem(
            bounds=again.bounds, centre=again.centre, sigma=again.sigma, particles=again.particles,
            iterations=again.iterations, feasible=inside, rng=again.rng, memory=first.memory,
        )
    )  # fmt: skip
    assert inside(following.run(sphere)[None])[0]


@pytest.mark.parametrize("name", NAMES)
def test_costs_that_stop_at_a_particles_bar_change_nothing(name):
    """Whatever lies between the bar and the cost, for a point that does not get below its bar."""
    spared = 0

    def stopping(points, cutoff_costs=None):
        nonlocal spared
        costs = sphere(points)
        if cutoff_costs is None:
            return costs
        assert cutoff_costs.shape == costs.shape
        loses = costs >= cutoff_costs
        spared += int(loses.sum())
        return np.where(
            loses,
            np.maximum(cutoff_costs, 0.3 * np.maximum(cutoff_costs, 0.0) + 0.7 * costs),
            costs,
        )

    searches = [ALGORITHMS[name](problem(particles=20, iterations=15)) for _ in range(2)]
    full, early = searches[0].run(sphere), searches[1].run(stopping, early=True)
    assert full.tobytes() == early.tobytes()
    assert searches[0].best_cost == searches[1].best_cost
    assert (spared > 0) == (name not in ("apf", "pf"))
