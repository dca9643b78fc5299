"""SPPSO's swarm: its equations by hand, its budget, its constraints, its seed."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from markerless_tracker.errors import SearchError
from markerless_tracker.optim import UPDATES, Problem, Sppso, everything_feasible
from markerless_tracker.optim.sampling import ATTEMPTS
from markerless_tracker.optim.sppso import acceleration, constricted_step, constriction


def problem(feasible=everything_feasible, *, d=3, particles=8, iterations=15, seed=1, sigma=0.5):
    return Problem(
        bounds=np.tile([[-np.inf], [np.inf]], (1, d)),
        centre=np.linspace(1.0, 2.0, d),
        sigma=np.full(d, sigma),
        particles=particles,
        iterations=iterations,
        feasible=feasible,
        rng=np.random.default_rng(seed),
    )


def sphere(points):
    return np.sum(points**2, axis=1)


def test_acceleration_grows_from_2_05_to_2_15():
    """Eq 2 for k = 2 .. N."""
    assert acceleration(2, 20) == 2.05
    assert acceleration(20, 20) == pytest.approx(2.15, abs=1e-15)
    assert acceleration(11, 20) == pytest.approx(2.10, abs=1e-15)
    # With two iterations the slope is undefined.
    assert acceleration(2, 2) == 2.05


def test_constriction_of_the_paper():
    """Eq 3: φ = 4.1 and 4.3."""
    assert constriction(2.05) == pytest.approx(0.72984, abs=5e-6)
    assert constriction(2.15) == pytest.approx(0.58211, abs=5e-6)


def test_one_step_by_hand():
    """χ(2.05) = 2 / |2 - 4.1 - sqrt(0.41)| = 0.729843788; every draw written out."""
    x = np.array([[1.0, -2.0, 0.5]])
    v = np.array([[0.1, 0.0, -0.2]])
    best = np.array([[1.2, -2.0, 0.0]])
    leader = np.array([0.0, 1.0, 0.5])
    r1 = np.array([[0.5, 0.9, 0.2]])
    r2 = np.array([[0.25, 0.1, 0.7]])
    # 0.1 + 2.05 · 0.5 · 0.2 + 2.05 · 0.25 · (-1.0) = -0.2075
    # 0.0 + 2.05 · 0.9 · 0.0 + 2.05 · 0.1 · 3.0     =  0.615
    # -0.2 + 2.05 · 0.2 · (-0.5) + 0                = -0.405
    chi = 0.729843788128
    expected = chi * np.array([[-0.2075, 0.615, -0.405]])
    new_x, new_v = constricted_step(x, v, best, leader, r1, r2, 2.05, np.full(3, 10.0))
    np.testing.assert_allclose(new_v, expected, rtol=1e-11)
    np.testing.assert_allclose(new_x, x + expected, rtol=1e-11)
    # Clamped: 0.1 on the second, nothing of the third.
    new_x, new_v = constricted_step(x, v, best, leader, r1, r2, 2.05, np.array([0.2, 0.1, 0.0]))
    np.testing.assert_allclose(new_v, [[expected[0, 0], 0.1, 0.0]], rtol=1e-11)
    np.testing.assert_allclose(new_x, [[1.0 + expected[0, 0], -1.9, 0.5]], rtol=1e-11)


@given(st.integers(0, 2**32 - 1), st.floats(2.0001, 3.0))
def test_no_step_is_longer_than_the_greatest_speed(seed, c):
    rng = np.random.default_rng(seed)
    x, v, best = rng.normal(0.0, 100.0, (3, 4, 2))
    v_max = rng.uniform(0.0, 1.0, 2)
    new_x, new_v = constricted_step(
        x, v, best, rng.normal(0.0, 100.0, 2), *rng.random((2, 4, 2)), c, v_max
    )
    assert (np.abs(new_v) <= v_max).all()
    np.testing.assert_array_equal(new_x, x + new_v)


@pytest.mark.parametrize("update", UPDATES)
def test_the_first_move_of_the_swarm_by_hand(update):
    """Follows particle 0 from the draws: sample, velocity, one step towards the best."""
    search = Sppso(problem(particles=3, iterations=5), update=update)
    rng = np.random.default_rng(1)
    x = search.problem.centre + 0.5 * rng.standard_normal((3, 3))
    v = 0.5 * rng.uniform(-1.0, 1.0, (3, 3))
    batch = 3 if update == "iteration" else 1
    for batch_index in range(3 // batch):
        asked = search.ask()
        np.testing.assert_array_equal(asked, x[batch_index * batch : (batch_index + 1) * batch])
        search.tell(sphere(asked))
    leader = x[np.argmin(sphere(x))]
    r1, r2 = rng.random((2, batch, 3))
    moved, _ = constricted_step(
        x[:batch], v[:batch], x[:batch], leader, r1, r2, 2.05, np.full(3, 1.0)
    )
    np.testing.assert_array_equal(search.ask(), moved)


@pytest.mark.parametrize("update", UPDATES)
@pytest.mark.parametrize(("particles", "iterations"), [(10, 20), (20, 40), (1, 1), (3, 2), (1, 7)])
def test_the_budget_is_spent_exactly(update, particles, iterations):
    evaluated = []
    search = Sppso(problem(particles=particles, iterations=iterations), update=update)
    search.run(lambda x: evaluated.append(len(x)) or sphere(x))
    assert sum(evaluated) == search.evaluations == particles * iterations
    assert set(evaluated) == {particles if update == "iteration" else 1}
    assert search.finished


@pytest.mark.parametrize("update", UPDATES)
def test_it_finds_the_minimum_of_a_sphere(update):
    search = Sppso(problem(particles=20, iterations=60, sigma=1.0), update=update)
    best = search.run(sphere)
    assert np.abs(best).max() < 1e-3
    assert search.best_cost == sphere(best[None])[0]


@pytest.mark.parametrize("update", UPDATES)
def test_the_best_never_gets_worse_and_is_what_was_evaluated(update):
    search = Sppso(problem(), update=update)
    seen = []
    while not search.finished:
        points = search.ask()
        costs = sphere(points)
        search.tell(costs)
        seen.extend(costs)
        assert search.best_cost == min(seen)


def test_the_two_updates_differ_in_when_the_leader_is_known():
    a, b = (Sppso(problem(), update=update).run(sphere) for update in UPDATES)
    assert not np.array_equal(a, b)


@pytest.mark.parametrize("update", UPDATES)
def test_the_same_seed_gives_the_same_result_and_another_another(update):
    runs = [Sppso(problem(seed=seed), update=update).run(sphere).tobytes() for seed in (1, 1, 2)]
    assert runs[0] == runs[1] != runs[2]


@pytest.mark.parametrize("update", UPDATES)
def test_speeds_stay_below_twice_sigma(update):
    search = Sppso(problem(sigma=0.05, particles=4, iterations=30), update=update)
    tracks = []
    while not search.finished:
        points = search.ask()
        tracks.append(points.copy())
        # The leader is far away: without a clamp speeds would grow.
        search.tell(sphere(points))
    path = np.concatenate(tracks).reshape(30, 4, 3)
    steps = np.abs(np.diff(path, axis=0))
    assert steps.max() <= 0.1 * (1.0 + 1e-12)
    assert steps.max() > 0.09


@pytest.mark.parametrize("update", UPDATES)
@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_the_best_keeps_the_constraints(update, seed):
    """The minimum lies outside: what wins lies inside all the same."""

    def feasible(points):
        return (points >= 1.0).all(axis=1) & (points <= 3.0).all(axis=1)

    search = Sppso(
        problem(feasible, sigma=0.3, seed=seed, particles=5, iterations=8), update=update
    )
    best = search.run(sphere)
    assert feasible(best[None])[0] or np.array_equal(best, search.problem.centre)
    assert search.evaluations == 40
    assert search.best_cost == sphere(best[None])[0]


def test_a_move_is_tried_at_most_ten_times_from_where_the_particle_was():
    calls = []

    def feasible(points):
        calls.append(points.copy())
        # All first samples pass, then nothing does.
        return np.full(len(points), len(calls) == 1)

    search = Sppso(problem(feasible, particles=6, iterations=3))
    first = search.ask()
    search.tell(sphere(first))
    calls[1:] = []
    second = search.ask()
    tried = calls[1:]
    assert [len(points) for points in tried] == [6] * ATTEMPTS
    # Fresh draws each time, every one a step of at most 2 sigma from the same place.
    assert len({points.tobytes() for points in tried}) == ATTEMPTS
    for points in tried:
        assert np.abs(points - first).max() <= 1.0 + 1e-12
    # The last one is moved to all the same, counted, and cannot win.
    np.testing.assert_array_equal(second, tried[-1])
    search.tell(np.full(6, -math.inf))
    np.testing.assert_array_equal(search.best_x, first[np.argmin(sphere(first))])
    assert (search.evaluations, search.bad_costs) == (12, 6)
    third = search.ask()
    search.tell(np.full(6, -1.0))
    assert search.best_cost == sphere(first).min()
    assert np.abs(third - second).max() <= 1.0 + 1e-12


def test_an_infeasible_particle_does_not_become_its_own_best():
    """After an infeasible move of low cost, the pull goes to the earlier, feasible position."""
    allowed = [True]

    def feasible(points):
        return np.full(len(points), allowed[0])

    search = Sppso(problem(feasible, particles=1, iterations=40, sigma=0.2))
    start = search.ask()
    search.tell(np.zeros(1))
    allowed[0] = False
    path = []
    while not search.finished:
        path.append(search.ask()[0])
        search.tell(np.full(1, -100.0))
    np.testing.assert_array_equal(search.best_x, start[0])
    # All pulls lead back to the start, so the particle comes to rest there.
    assert np.abs(np.array(path[-5:]) - start).max() < 0.1


def test_only_failed_particles_are_drawn_again():
    counts = []

    def feasible(points):
        counts.append(len(points))
        return points[:, 0] < 1.4

    search = Sppso(problem(feasible, particles=50, iterations=2, sigma=0.5))
    search.tell(sphere(search.ask()))
    counts.clear()
    points = search.ask()
    assert counts[0] == 50
    assert all(a > b for a, b in zip(counts, counts[1:], strict=False))
    assert (points[:, 0] >= 1.4).sum() < counts[-1] or len(counts) < ATTEMPTS


def test_bad_costs_do_not_stop_the_search():
    def half_bad(points):
        costs = sphere(points)
        costs[points[:, 0] > 1.0] = np.nan
        return costs

    search = Sppso(problem(particles=10, iterations=30))
    best = search.run(half_bad)
    assert best[0] <= 1.0
    assert search.bad_costs > 0
    assert np.isfinite(search.best_cost)


def test_an_unknown_update_is_refused():
    with pytest.raises(SearchError, match="update is 'never', expected one of iteration, particle"):
        Sppso(problem(), update="never")
