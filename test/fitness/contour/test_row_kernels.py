"""Normal equations from rows, and elimination: against NumPy."""

import numpy as np
import pytest

from markerless_tracker.fitness.contour.row_kernels import (
    add_pose_prior,
    eliminated,
    normal_equations,
    solved,
)


@pytest.fixture
def rows():
    rng = np.random.default_rng(3)
    jacobian = rng.normal(size=(200, 14)) * (rng.random((200, 14)) < 0.4)
    return jacobian, rng.random(200), rng.normal(size=200)


def test_sums_over_rows(rows) -> None:
    jacobian, weight, value = rows
    hessian, gradient = normal_equations(jacobian, weight, value)
    np.testing.assert_allclose(hessian, jacobian.T @ (weight[:, None] * jacobian), atol=1e-12)
    np.testing.assert_allclose(gradient, jacobian.T @ (weight * value), atol=1e-12)
    np.testing.assert_array_equal(hessian, hessian.T)


def test_rows_may_be_views_of_other_layout(rows) -> None:
    jacobian, weight, value = rows
    hessian, _ = normal_equations(np.asfortranarray(jacobian), weight, value)
    np.testing.assert_array_equal(hessian, normal_equations(jacobian, weight, value)[0])


def test_elimination_gives_the_same_step_as_solving_all_at_once(rows) -> None:
    hessian, gradient = normal_equations(*rows)
    hessian += 0.1 * np.eye(14)
    whole = -np.linalg.solve(hessian, gradient)
    others, pull = np.zeros((8, 8)), np.zeros(8)
    part = eliminated(hessian, gradient, 6, others, pull)
    step = solved(others, pull)
    np.testing.assert_allclose(step, whole[6:], rtol=1e-9)
    np.testing.assert_allclose(-part @ np.append(step, 1.0), whole[:6], rtol=1e-9)


def test_the_reduced_equations_are_added(rows) -> None:
    hessian, gradient = normal_equations(*rows)
    hessian += 0.1 * np.eye(14)
    once, twice = (np.zeros((8, 8)), np.zeros(8)), (np.zeros((8, 8)), np.zeros(8))
    eliminated(hessian, gradient, 6, *once)
    for _ in range(2):
        eliminated(hessian, gradient, 6, *twice)
    np.testing.assert_allclose(twice[0], 2.0 * once[0])
    np.testing.assert_allclose(twice[1], 2.0 * once[1])


def test_a_pose_without_residuals_steps_to_its_prior(rows) -> None:
    hessian, gradient = normal_equations(rows[0] * (np.arange(14) >= 6), *rows[1:])
    others = hessian[6:, 6:].copy()
    off = np.linspace(-1.0, 1.0, 6)
    add_pose_prior(hessian, gradient, np.linspace(0.5, 3.0, 6), off, damping=0.25)
    np.testing.assert_allclose(solved(hessian, gradient)[:6], -off / 1.25, rtol=1e-6)
    np.testing.assert_array_equal(hessian[6:, 6:], others)
