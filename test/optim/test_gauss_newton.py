"""Damped steps and the refinement made of them, on problems with known answers."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import lsq_linear

from markerless_tracker.errors import SearchError
from markerless_tracker.optim import Prior, refine
from markerless_tracker.optim.gauss_newton import damped_step

FREE = np.array([[-np.inf] * 4, [np.inf] * 4])
SEEDS = st.integers(0, 2**32 - 1)


def quadratic(rng, size=4):
    """A well-conditioned (H, minimum) of ½ (x - minimum)ᵀ H (x - minimum)."""
    a = rng.standard_normal((2 * size, size))
    return a.T @ a + 0.5 * np.eye(size), rng.uniform(-1, 1, size)


# --- one step ---------------------------------------------------------------------------------


@settings(max_examples=30, deadline=None)
@given(SEEDS)
def test_a_step_without_damping_reaches_the_minimum(seed) -> None:
    rng = np.random.default_rng(seed)
    h, minimum = quadratic(rng)
    x = rng.uniform(-5, 5, 4)
    step = damped_step(h, h @ (x - minimum), x, FREE, 0.0)
    np.testing.assert_allclose(x + step, minimum, atol=1e-7)


def test_damping_shortens_the_step() -> None:
    """(1 + λ) H_ii step_i = -gradient_i when H is diagonal."""
    h, gradient, x = np.diag([4.0, 1.0, 2.0, 10.0]), np.array([8.0, -1.0, 0.0, 5.0]), np.zeros(4)
    step = damped_step(h, gradient, x, FREE, 0.25)
    np.testing.assert_allclose(step, [-1.6, 0.8, 0.0, -0.4], rtol=1e-9)


def test_a_held_parameter_changes_the_others_step() -> None:
    """H = [[2, 1], [1, 2]], minimum (2, -1): with x_0 held at 1, x_1 moves to -½, not to -1."""
    h, minimum = np.array([[2.0, 1.0], [1.0, 2.0]]), np.array([2.0, -1.0])
    bounds = np.array([[-3.0, -3.0], [1.0, 3.0]])
    step = damped_step(h, -h @ minimum, np.zeros(2), bounds, 0.0)
    np.testing.assert_allclose(step, [1.0, -0.5], rtol=1e-9)


@settings(max_examples=60, deadline=None)
@given(SEEDS, st.sampled_from([2, 4, 12]), st.sampled_from([0.1, 0.25, 0.6]))
def test_a_bounded_step_against_scipy(seed, size, most) -> None:
    rng = np.random.default_rng(seed)
    a, b = rng.standard_normal((2 * size + 1, size)), rng.standard_normal(2 * size + 1)
    x = rng.uniform(-most, most, size)
    bounds = np.array([np.full(size, -most), np.full(size, most)])
    found = x + damped_step(a.T @ a, a.T @ (a @ x - b), x, bounds, 0.0)
    assert (np.abs(found) <= most * (1 + 1e-12)).all()
    exact = lsq_linear(a, b, bounds=bounds, tol=1e-15)
    assert np.sum((a @ found - b) ** 2) / 2 <= exact.cost * (1 + 1e-6)


def test_a_parameter_is_released_from_a_bound_that_it_leaves_for_good() -> None:
    """Alone, both would go beyond 1; with x_0 held there, x_1's best is back inside."""
    h, minimum = np.array([[1.0, 0.8], [0.8, 1.0]]), np.array([3.0, 1.1])
    bounds = np.array([[-9.0, -9.0], [1.0, 1.0]])
    step = damped_step(h, -h @ minimum, np.zeros(2), bounds, 0.0)
    # x_1 alone: 1.1 + 0.8 (3 - 1) = 2.7, beyond as well: both stay.
    np.testing.assert_array_equal(step, [1.0, 1.0])
    step = damped_step(h * [[1, -1], [-1, 1]], -h * [[1, -1], [-1, 1]] @ minimum, np.zeros(2),
                       bounds, 0.0)  # fmt: skip
    # With the signs exchanged: 1.1 - 0.8 (3 - 1) = -0.5.
    np.testing.assert_allclose(step, [1.0, -0.5], rtol=1e-9)


def test_every_parameter_out_of_bounds() -> None:
    bounds = np.array([np.full(4, -0.1), np.full(4, 0.1)])
    step = damped_step(np.eye(4), np.array([1.0, -1.0, 2.0, -2.0]), np.zeros(4), bounds, 0.0)
    np.testing.assert_array_equal(step, [-0.1, 0.1, -0.1, 0.1])


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("where", ["hessian", "gradient"])
def test_equations_that_are_not_finite(bad, where) -> None:
    h, gradient = np.eye(4), np.ones(4)
    (h if where == "hessian" else gradient)[1] = bad
    for bounds in (FREE, np.clip(FREE, -1.0, 1.0)):
        with pytest.raises(SearchError, match="contour refinement: .* not finite") as error:
            damped_step(h, gradient, np.zeros(4), bounds, 1e-3)
        assert "\n" not in str(error.value)


def test_singular_equations() -> None:
    damping = 1e-3
    whole = np.full((4, 4), 1.0 + (damping + 1e-12))
    whole[np.diag_indices(4)] = 1.0
    with pytest.raises(SearchError, match="the normal equations are singular"):
        damped_step(whole, np.ones(4), np.zeros(4), FREE, damping)


def test_a_parameter_without_evidence_stays() -> None:
    h, gradient = np.diag([2.0, 0.0, 1.0, 1.0]), np.array([2.0, 0.0, 0.0, 0.0])
    step = damped_step(h, gradient, np.zeros(4), FREE, 1e-3)
    assert step[0] == pytest.approx(-1.0 / 1.001) and not step[1:].any()


# --- refinement -------------------------------------------------------------------------------


class Recorded:
    """Normal equations of a quadratic, and what was asked of them."""

    def __init__(self, h, minimum) -> None:
        self.h, self.minimum = h, minimum
        self.points, self.truncations = [], []

    def __call__(self, x, truncation_m):
        self.points.append(x.copy())
        self.truncations.append(truncation_m)
        return self.h, self.h @ (x - self.minimum)


def run(equations, start, *, priors=(), bounds=FREE, iterations=6, truncation=(0.1, 0.02)):
    return refine(
        equations, start, priors=priors, bounds=bounds, iterations=iterations, truncation=truncation
    )


def test_refinement_converges_to_the_minimum() -> None:
    equations = Recorded(*quadratic(np.random.default_rng(1)))
    np.testing.assert_allclose(run(equations, np.full(4, 3.0)), equations.minimum, atol=1e-8)
    assert len(equations.points) == 6


def test_the_truncation_shrinks_geometrically() -> None:
    equations = Recorded(np.eye(4), np.zeros(4))
    run(equations, np.ones(4), iterations=4, truncation=(0.16, 0.02))
    np.testing.assert_allclose(equations.truncations, [0.16, 0.08, 0.04, 0.02])


def test_a_single_iteration_takes_the_last_truncation() -> None:
    equations = Recorded(np.eye(4), np.zeros(4))
    run(equations, np.ones(4), iterations=1, truncation=(0.16, 0.02))
    assert equations.truncations == [pytest.approx(0.02)]


def test_priors_pull_to_the_weighted_mean() -> None:
    """Data say 1 with precision 4, one belief 0 with 1, another -2 with 3: (4 - 6) / 8 = -¼."""
    start = np.zeros(4)
    precision = np.array([3.0, 0.0, 3.0, 3.0])
    priors = (Prior(np.zeros(4), np.ones(4)), Prior(np.full(4, -2.0), precision))
    found = run(Recorded(4.0 * np.eye(4), np.ones(4)), start, priors=priors, iterations=8)
    np.testing.assert_allclose(found, [-0.25, 0.8, -0.25, -0.25], atol=1e-9)


def test_a_belief_without_precision_does_not_matter() -> None:
    prior = Prior(np.full(4, 1e6), np.zeros(4))
    equations = Recorded(*quadratic(np.random.default_rng(2)))
    plain = run(equations, np.ones(4))
    assert run(equations, np.ones(4), priors=(prior,)).tobytes() == plain.tobytes()


def test_the_caller_keeps_his_equations() -> None:
    h = np.eye(4)
    equations = Recorded(h, np.zeros(4))
    start = np.ones(4)
    run(equations, start, priors=(Prior(np.zeros(4), np.ones(4)),))
    np.testing.assert_array_equal(h, np.eye(4))
    np.testing.assert_array_equal(start, np.ones(4))


@settings(max_examples=30, deadline=None)
@given(SEEDS)
def test_refinement_within_bounds_against_scipy(seed) -> None:
    rng = np.random.default_rng(seed)
    a, b = rng.standard_normal((9, 4)), rng.standard_normal(9)
    bounds = np.array([np.full(4, -0.3), np.full(4, 0.3)])
    seen = []

    def equations(x, truncation_m):
        seen.append(x)
        return a.T @ a, a.T @ (a @ x - b)

    found = run(equations, rng.uniform(-2, 2, 4), bounds=bounds, iterations=8)
    for x in [*seen, found]:
        assert (x >= bounds[0]).all() and (x <= bounds[1]).all()
    exact = lsq_linear(a, b, bounds=bounds, tol=1e-14)
    assert np.sum((a @ found - b) ** 2) / 2 <= exact.cost * (1 + 1e-6)


def test_a_start_out_of_bounds_is_put_on_them() -> None:
    bounds = np.array([np.zeros(4), np.ones(4)])
    equations = Recorded(np.eye(4), np.full(4, 0.5))
    run(equations, np.array([-5.0, 5.0, 0.2, 0.3]), bounds=bounds)
    np.testing.assert_array_equal(equations.points[0], [0.0, 1.0, 0.2, 0.3])


@pytest.mark.parametrize("bad", ["singular", "nan", "inf"])
@pytest.mark.parametrize("after", [0, 2])
def test_equations_that_cannot_be_solved_end_it_at_the_last_point(bad, after) -> None:
    good = Recorded(np.eye(4), np.zeros(4))

    def equations(x, truncation_m):
        h, gradient = good(x, truncation_m)
        if len(good.points) <= after:
            return h, gradient
        if bad == "singular":
            whole = np.full((4, 4), 1.0 + (1e-3 + 1e-12))
            whole[np.diag_indices(4)] = 1.0
            return whole, gradient
        return h, gradient * (np.nan if bad == "nan" else np.inf)

    start = np.full(4, 3.0)
    found = run(equations, start)
    assert len(good.points) == after + 1
    np.testing.assert_array_equal(found, good.points[-1])
    assert (found == start).all() == (after == 0)


def test_the_same_again_gives_the_same_bytes() -> None:
    h, minimum = quadratic(np.random.default_rng(3))
    bounds = np.array([np.full(4, -0.4), np.full(4, 0.4)])
    prior = Prior(np.full(4, 0.1), np.full(4, 0.7))
    first, second = (
        run(Recorded(h, minimum), np.full(4, 0.3), bounds=bounds, priors=(prior,)) for _ in range(2)
    )
    assert first.tobytes() == second.tobytes()


# --- against NumPy -----------------------------------------------------------------------------


def numpy_step(hessian, gradient, x, bounds, damping):
    """`damped_step` with NumPy's solution of the equations."""
    a = hessian + np.diag(damping * np.diag(hessian) + 1e-12)
    low, high = bounds[0] - x, bounds[1] - x
    step = np.linalg.solve(a, -gradient)
    below, above = step < low, step > high
    for _ in range(10):
        held = below | above
        if not held.any():
            break
        free = ~held
        step[held] = np.where(below, low, high)[held]
        right = -gradient[free] - a[np.ix_(free, held)] @ step[held]
        step[free] = np.linalg.solve(a[np.ix_(free, free)], right)
        pull = -(a @ step + gradient)
        now_below, now_above = (
            (step < low) | (below & (pull < 0)),
            (step > high) | (above & (pull > 0)),
        )
        if (now_below == below).all() and (now_above == above).all():
            break
        below, above = now_below, now_above
    return np.clip(x + step, *bounds) - x


@settings(max_examples=60, deadline=None)
@given(SEEDS, st.sampled_from([1, 3, 31]), st.sampled_from([0.1, 0.4, np.inf]))
def test_a_step_against_numpy(seed, size, most) -> None:
    rng = np.random.default_rng(seed)
    h, minimum = quadratic(rng, size)
    x = rng.uniform(-min(most, 1.0), min(most, 1.0), size)
    bounds = np.array([np.full(size, -most), np.full(size, most)])
    gradient = h @ (x - minimum)
    np.testing.assert_allclose(
        damped_step(h, gradient, x, bounds, 1e-3),
        numpy_step(h, gradient, x, bounds, 1e-3),
        atol=1e-9,
    )
