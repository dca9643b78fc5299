"""The particle filters: weights, layers and memory by hand."""

import numpy as np
import pytest

from markerless_tracker.errors import SearchError
from markerless_tracker.optim import Apf, ParticleSet, Pf, Problem, everything_feasible
from markerless_tracker.optim.apf import diffused, layer_sigma
from markerless_tracker.optim.weights import (
    annealed_sharpness,
    drawn_by_weight,
    survival,
    weights_from_costs,
)


def problem(*, particles=4, iterations=3, feasible=everything_feasible, memory=None):
    return Problem(
        bounds=np.array([[-np.inf] * 2, [np.inf] * 2]),
        centre=np.array([1.0, 2.0]),
        sigma=np.array([0.5, 0.25]),
        particles=particles,
        iterations=iterations,
        feasible=feasible,
        rng=np.random.default_rng(4),
        memory=memory,
    )


def sphere(points):
    return np.sum(points**2, axis=1)


def test_weights_by_hand():
    """exp(-2 · (0, ln 2, ln 4)) = 1, 1/4, 1/16; the infinite cost weighs nothing."""
    weights = weights_from_costs(np.array([5.0, 5.0 + np.log(2), np.inf, 5.0 + np.log(4)]), 2.0)
    np.testing.assert_allclose(weights, np.array([16.0, 4.0, 0.0, 1.0]) / 21.0, rtol=1e-14)
    np.testing.assert_array_equal(weights_from_costs(np.full(2, np.inf), 2.0), np.zeros(2))


def test_survival_by_hand():
    assert survival(np.array([0.25, 0.25, 0.25, 0.25])) == pytest.approx(1.0)
    assert survival(np.array([1.0, 0.0, 0.0, 0.0])) == 0.25
    # (4)² / (3 · (1 + 9)) = 16 / 30
    assert survival(np.array([1.0, 3.0, 0.0])) == pytest.approx(16.0 / 30.0)


@pytest.mark.parametrize("rate", [0.1, 0.5, 0.9])
def test_sharpness_lets_that_share_survive(rate):
    costs = np.random.default_rng(0).uniform(0.0, 0.02, 300)
    costs[:20] = np.inf
    beta = annealed_sharpness(costs, rate)
    assert survival(weights_from_costs(costs[20:], beta)) == pytest.approx(rate, abs=1e-6)


def test_sharpness_of_equal_costs_is_one():
    assert annealed_sharpness(np.full(7, 0.3), 0.5) == 1.0
    assert annealed_sharpness(np.full(7, np.inf), 0.5) == 1.0


def test_drawing_by_weight_by_hand():
    weights = np.array([0.2, 0.0, 0.5, 0.3])
    draws = np.array([0.0, 0.19, 0.2, 0.69, 0.71, 0.999999])
    np.testing.assert_array_equal(drawn_by_weight(weights, draws), [0, 0, 2, 2, 3, 3])


def test_a_layers_noise_shrinks_by_half_its_variance():
    sigma = np.array([0.4, 1.0])
    np.testing.assert_allclose(layer_sigma(sigma, 5, 5, 0.5), sigma)
    np.testing.assert_allclose(layer_sigma(sigma, 3, 5, 0.5), 0.5 * sigma)
    moved = diffused(
        np.array([[1.0, 2.0], [3.0, 4.0]]), np.array([1, 1]), np.array([[1.0, 0.0], [0.0, -2.0]]),
        sigma,
    )  # fmt: skip
    np.testing.assert_allclose(moved, [[3.4, 4.0], [3.0, 2.0]])


def test_two_layers_by_hand():
    search = Apf(problem(iterations=2))
    rng = np.random.default_rng(4)
    rng.random(4)
    first = [1.0, 2.0] + np.array([0.5, 0.25]) * rng.standard_normal((4, 2))
    asked = search.ask()
    np.testing.assert_allclose(asked, first, rtol=1e-15)
    costs = sphere(asked)
    search.tell(costs)
    weights = weights_from_costs(costs, annealed_sharpness(costs, 0.5))
    chosen = drawn_by_weight(weights, rng.random(4))
    noise = rng.standard_normal((4, 2))
    second = first[chosen] + np.sqrt(0.5) * np.array([0.5, 0.25]) * noise
    asked = search.ask()
    np.testing.assert_allclose(asked, second, rtol=1e-14)
    costs = sphere(asked)
    search.tell(costs)
    weights = weights_from_costs(costs, annealed_sharpness(costs, 0.5))
    np.testing.assert_allclose(search.estimate, weights @ second, rtol=1e-14)
    np.testing.assert_array_equal(Apf(problem(), estimate="best").estimate, [1.0, 2.0])


def test_the_next_frame_goes_on_from_the_last_layer_about_its_own_centre():
    memory = ParticleSet(np.array([[1.0, 0.0], [0.0, -1.0]]), np.array([0.0, 1.0]))
    search = Pf(problem(particles=2000, iterations=1, memory=memory))
    points = search.ask()
    # All of the weight is on the particle that lay 1 below the estimate.
    np.testing.assert_allclose(points.mean(axis=0), [1.0, 1.0], atol=0.05)
    np.testing.assert_allclose(points.std(axis=0), [0.5, 0.25], atol=0.03)
    search.tell(sphere(points))
    left = search.memory
    np.testing.assert_allclose(left.weights @ left.offsets, [0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(left.offsets + search.estimate, points, atol=1e-12)


def test_particles_that_break_a_constraint_are_rejected_and_not_drawn_again():
    asked = []

    def feasible(points):
        asked.append(len(points))
        return points[:, 0] > 1.0

    search = Apf(problem(particles=50, iterations=1, feasible=feasible), estimate="best")
    points = search.ask()
    assert asked == [50] and (points[:, 0] <= 1.0).any()
    search.tell(sphere(points))
    assert (search.memory.weights[points[:, 0] <= 1.0] == 0.0).all()
    assert search.best_x[0] > 1.0


def test_a_mean_that_breaks_a_constraint_gives_way_to_the_best():
    ring = problem(particles=400, iterations=1, feasible=lambda p: np.abs(p[:, 0] - 1.0) > 0.2)
    search = Apf(ring)
    # Equal costs on both sides: the mean lies between, where nothing may.
    search.run(lambda points: np.zeros(len(points)))
    np.testing.assert_array_equal(search.estimate, search.best_x)
    assert abs(search.estimate[0] - 1.0) > 0.2


def test_a_layer_of_which_nothing_is_left_is_passed_over():
    search = Apf(problem(iterations=3))
    first = search.ask()
    search.tell(sphere(first))
    search.ask()
    search.tell(np.full(4, np.nan))
    kept = search.memory
    np.testing.assert_allclose(kept.offsets + search.estimate, first, atol=1e-12)
    assert len(search.ask()) == 4


def test_an_unknown_estimate_is_refused():
    with pytest.raises(SearchError, match="estimate is 'mode', expected one of mean, best"):
        Apf(problem(), estimate="mode")


def test_a_memory_of_another_size_is_refused():
    with pytest.raises(SearchError, match="does not fit a centre of 2"):
        problem(memory=ParticleSet(np.zeros((3, 5)), np.ones(3) / 3))
