"""Sub-swarms and master: equations by hand, migration, sizes, who is asked when."""

import numpy as np
import pytest

from markerless_tracker.errors import SearchError
from markerless_tracker.optim import Mcpso, Problem, everything_feasible
from markerless_tracker.optim.mcpso import better, master_step, migration_factor, swarm_sizes
from markerless_tracker.optim.pso import inertia_step


def problem(*, particles=8, iterations=5):
    return Problem(
        bounds=np.array([[-np.inf] * 2, [np.inf] * 2]),
        centre=np.array([1.0, 2.0]),
        sigma=np.full(2, 0.5),
        particles=particles,
        iterations=iterations,
        feasible=everything_feasible,
        rng=np.random.default_rng(4),
    )


def sphere(points):
    return np.sum(points**2, axis=1)


@pytest.mark.parametrize(
    ("particles", "sub_swarms", "sizes"),
    [
        (20, 2, (7, 7, 6)), (20, 3, (5, 5, 5, 5)), (20, 4, (4, 4, 4, 4, 4)),
        (20, 5, (3, 3, 3, 3, 3, 5)), (40, 3, (10,) * 4), (60, 3, (15,) * 4), (4, 3, (1, 1, 1, 1)),
        (6, 3, (1, 1, 1, 3)), (21, 3, (5, 5, 5, 6)), (2, 1, (1, 1)), (7, 3, (2, 2, 2, 1)),
    ],
)  # fmt: skip
def test_particles_are_shared_out_as_in_table_4(particles, sub_swarms, sizes):
    assert swarm_sizes(particles, sub_swarms) == sizes
    assert sum(sizes) == particles


def test_every_number_of_particles_that_can_be_shared_out_is():
    for sub_swarms in range(1, 12):
        for particles in range(sub_swarms + 1, 60):
            *subs, master = swarm_sizes(particles, sub_swarms)
            assert sum(subs) + master == particles and min(*subs, master) >= 1
    for particles, sub_swarms in ((3, 3), (5, 0)):
        with pytest.raises(SearchError, match="particles for .* sub-swarms and a master"):
            swarm_sizes(particles, sub_swarms)


def test_migration_factor_of_eq_5():
    """Costs: the better sub-swarm attracts fully, the worse not at all."""
    assert migration_factor(1.0, 2.0) == 0.0
    assert migration_factor(2.0, 2.0) == 0.5
    assert migration_factor(3.0, 2.0) == 1.0
    assert migration_factor(np.inf, np.inf) == 0.5
    assert better(1.0, 2.0) and not better(2.0, 2.0) and not better(np.inf, np.inf)


def test_one_master_step_by_hand():
    """Eqs 3, 4: 0.5 v + 2 r1 (p - x) + 2 r2 (g - x) + (1 - ϕ) 3 r3 (s - x)."""
    x, v, best = np.array([[1.0]]), np.array([[0.2]]), np.array([[1.5]])
    leader, sub = np.array([2.0]), np.array([-1.0])
    draws = np.array([[[0.5]], [[0.25]], [[0.1]]])
    far = np.array([10.0])
    # 0.1 + 2 · 0.5 · 0.5 + 2 · 0.25 · 1.0 + (1 - ϕ) · 3 · 0.1 · (-2.0)
    for phi, expected in ((1.0, 1.1), (0.5, 0.8), (0.0, 0.5)):
        new_x, new_v = master_step(x, v, best, leader, sub, draws, 0.5, 2.0, 3.0, phi, far)
        np.testing.assert_allclose(new_v, [[expected]], rtol=1e-14)
        np.testing.assert_allclose(new_x, [[1.0 + expected]], rtol=1e-14)
    _, new_v = master_step(x, v, best, leader, sub, draws, 0.5, 2.0, 3.0, 0.0, np.array([0.3]))
    np.testing.assert_array_equal(new_v, [[0.3]])
    _, new_v = master_step(
        x, v, best, leader, sub, draws, 0.5, 2.0, 3.0, 0.5, far, master_weight=0.5
    )
    np.testing.assert_allclose(new_v, [[0.55]], rtol=1e-14)


def test_everybody_first_then_sub_swarms_in_one_batch_and_the_master():
    search = Mcpso(problem(particles=20, iterations=4), sub_swarms=3)
    asked = []
    search.run(lambda x: asked.append(len(x)) or sphere(x))
    assert asked == [20, 15, 5, 15, 5, 15, 5]


def test_the_first_moves_by_hand():
    """Two sub-swarms of three and a master of two, from the draws."""
    search = Mcpso(problem(), sub_swarms=2)
    rng = np.random.default_rng(4)
    x = [1.0, 2.0] + 0.5 * rng.standard_normal((8, 2))
    v = 0.5 * rng.uniform(-1.0, 1.0, (8, 2))
    first = search.ask()
    np.testing.assert_array_equal(first, x)
    costs = sphere(x)
    search.tell(costs)
    r1, r2 = rng.random((2, 6, 2))
    leaders = np.repeat([x[np.argmin(costs[:3])], x[3 + np.argmin(costs[3:6])]], 3, axis=0)
    moved, _ = inertia_step(x[:6], v[:6], x[:6], leaders, r1, r2, 2.0, 2.05, np.ones(2))
    np.testing.assert_array_equal(search.ask(), moved)

    # The first sub-swarm finds something splendid, the second something good.
    search.tell(np.array([9.0, -5.0, 9.0, 9.0, 9.0, -3.0]))
    master = x[6:].copy()
    order = np.argsort(costs[6:])[::-1]
    master[order[0]] = moved[1]
    # Now the other of the master's is its worst, which the second sub-swarm's best replaces.
    master[order[1]] = moved[5]
    draws = rng.random((3, 2, 2))
    stepped, _ = master_step(
        master, v[6:], master, moved[1], moved[1], draws, 2.0, 2.05, 2.0, 0.0, np.ones(2)
    )
    np.testing.assert_array_equal(search.ask(), stepped)


def test_a_sub_swarm_that_is_worse_neither_enters_nor_attracts():
    search = Mcpso(problem(), sub_swarms=2)
    first = search.ask()
    # The master's two are better than all others will ever be.
    search.tell(np.array([5.0, 5.0, 5.0, 5.0, 5.0, 5.0, 1.0, 2.0]))
    search.tell(np.full(len(search.ask()), 4.0))
    state = np.random.default_rng(4)
    state.standard_normal((8, 2))
    v = 0.5 * state.uniform(-1.0, 1.0, (8, 2))
    state.random((2, 6, 2))
    draws = state.random((3, 2, 2))
    expected, _ = master_step(
        first[6:], v[6:], first[6:], first[6], first[0], draws, 2.0, 2.05, 2.0, 1.0, np.ones(2)
    )
    np.testing.assert_array_equal(search.ask(), expected)


def test_it_finds_the_minimum_of_a_sphere():
    for term in ("printed", "weighted"):
        search = Mcpso(problem(particles=20, iterations=60), master_term=term)
        assert np.abs(search.run(sphere)).max() < 1e-2


def test_an_unknown_term_is_refused():
    with pytest.raises(SearchError, match="master_term is 'new', expected one of printed, weight"):
        Mcpso(problem(), master_term="new")
