"""PSO with inertia: its equations by hand, its swarm's first move."""

import numpy as np
import pytest

from markerless_tracker.errors import SearchError
from markerless_tracker.optim import Problem, Pso, everything_feasible
from markerless_tracker.optim.pso import inertia, inertia_step
from markerless_tracker.optim.swarm import Swarm, confine


def problem(*, particles=3, iterations=5, bound=np.inf, feasible=everything_feasible, sigma=0.5):
    return Problem(
        bounds=np.array([[-bound] * 2, [bound] * 2]),
        centre=np.array([1.0, 2.0]),
        sigma=np.full(2, sigma),
        particles=particles,
        iterations=iterations,
        feasible=feasible,
        rng=np.random.default_rng(4),
    )


def sphere(points):
    return np.sum(points**2, axis=1)


def test_inertia_falls_exponentially_from_2_to_a_tenth():
    """Eqs 6, 7 with the logarithm: 29 moves in 30 iterations."""
    values = [inertia(k, 30, 2.0, 0.1) for k in range(2, 31)]
    assert values[0] == 2.0
    assert values[-1] == pytest.approx(0.1, rel=1e-12)
    # Half way the geometric mean: sqrt(2.0 · 0.1).
    assert values[14] == pytest.approx(0.4472136, rel=1e-6)
    np.testing.assert_allclose(np.diff(np.log(values)), -np.log(20.0) / 28.0)
    # Above 1 for the first seven moves.
    assert sum(w > 1.0 for w in values) == 7
    assert inertia(2, 2, 2.0, 0.1) == 2.0


def test_one_step_by_hand():
    """Eqs 1, 2; every draw written out."""
    x, v = np.array([[1.0, -2.0]]), np.array([[0.1, -0.2]])
    best, leader = np.array([[1.2, -2.0]]), np.array([0.0, 1.0])
    r1, r2 = np.array([[0.5, 0.9]]), np.array([[0.25, 0.1]])
    # 0.5 · 0.1 + 2 · 0.5 · 0.2 + 2 · 0.25 · (-1.0) = -0.25
    # 0.5 · (-0.2) + 0 + 2 · 0.1 · 3.0              =  0.5
    new_x, new_v = inertia_step(x, v, best, leader, r1, r2, 0.5, 2.0, np.full(2, 10.0))
    np.testing.assert_allclose(new_v, [[-0.25, 0.5]], rtol=1e-14)
    np.testing.assert_allclose(new_x, [[0.75, -1.5]], rtol=1e-14)
    new_x, new_v = inertia_step(x, v, best, leader, r1, r2, 0.5, 2.0, np.array([0.2, 0.0]))
    np.testing.assert_allclose(new_v, [[-0.2, 0.0]], rtol=1e-14)
    np.testing.assert_allclose(new_x, [[0.8, -2.0]], rtol=1e-14)


def test_the_first_move_by_hand():
    search = Pso(problem())
    rng = np.random.default_rng(4)
    x = [1.0, 2.0] + 0.5 * rng.standard_normal((3, 2))
    v = 0.5 * rng.uniform(-1.0, 1.0, (3, 2))
    asked = search.ask()
    np.testing.assert_array_equal(asked, x)
    search.tell(sphere(asked))
    r1, r2 = rng.random((2, 3, 2))
    leader = x[np.argmin(sphere(x))]
    moved, _ = inertia_step(x, v, x, leader, r1, r2, 2.0, 2.05, np.ones(2))
    np.testing.assert_array_equal(search.ask(), moved)


def test_a_particle_that_leaves_the_bounds_stops_on_them():
    x, v = confine(
        np.array([[1.5, 0.2], [-3.0, 0.0]]), np.array([[0.5, 0.3], [-1.0, 0.4]]),
        np.array([[-1.0, -1.0], [1.0, 1.0]]),
    )  # fmt: skip
    np.testing.assert_array_equal(x, [[1.0, 0.2], [-1.0, 0.0]])
    np.testing.assert_array_equal(v, [[0.0, 0.3], [0.0, 0.4]])


def test_every_point_asked_for_lies_within_bounds():
    search = Pso(problem(bound=2.1, particles=20, iterations=10, sigma=2.0))
    while not search.finished:
        points = search.ask()
        assert (np.abs(points) <= 2.1).all()
        search.tell(-points[:, 0])
    assert search.best_x[0] == 2.1


def test_a_particle_is_infeasible_after_ten_attempts():
    swarm = Swarm(np.zeros((2, 2)), np.zeros((2, 2)))
    tried = []

    def step(rows):
        tried.append(rows.tolist())
        return np.full((rows.size, 2), float(len(tried))), np.zeros((rows.size, 2))

    def feasible(points):
        return points[:, 0] == 1.0 if len(points) < 2 else np.array([True, False])

    swarm.move(problem(feasible=feasible), step)
    assert tried == [[0, 1], *[[1]] * 9]
    np.testing.assert_array_equal(swarm.infeasible, [False, True])
    np.testing.assert_array_equal(swarm.x, [[1.0, 1.0], [10.0, 10.0]])


def test_it_finds_the_minimum_of_a_sphere():
    assert np.abs(Pso(problem(particles=20, iterations=60, sigma=1.0)).run(sphere)).max() < 1e-2


def test_an_inertia_that_grows_is_refused():
    with pytest.raises(SearchError, match="inertia_min is 3, expected above 0 and at most"):
        Pso(problem(), inertia_min=3.0)
