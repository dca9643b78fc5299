"""Levenberg-Marquardt steps on sparse residuals with a robust loss.

Camera and board parameters are strongly correlated: the iterative solver of
`scipy.optimize.least_squares` for sparse Jacobians (LSMR) needs thousands of steps there. Here the
normal equations of a few hundred parameters are solved directly.
"""

from collections.abc import Callable

import numpy as np
from scipy.linalg import LinAlgError, cho_factor, cho_solve
from scipy.sparse import csr_matrix, diags

from markerless_tracker.geometry import FloatArray

Model = Callable[[FloatArray], tuple[FloatArray, csr_matrix]]

_FIRST_DAMPING, _LEAST_DAMPING, _MOST_DAMPING = 1e-4, 1e-12, 1e8
_STEPS = 60
_PROGRESS = 1e-9


def minimised(model: Model, start: FloatArray, *, loss_px: float | None) -> FloatArray:
    """The parameters (p,) of least cost near a start.

    Damping is relative to the diagonal of the normal equations (Marquardt 1963).

    Args:
        model: parameters (p,) -> residuals (n,) and Jacobian (n, p).
        start: (p,).
        loss_px: residuals larger than this count less (soft L1: 2 c^2 (sqrt(1 + r^2 / c^2) - 1)),
            None for squares.
    """
    value, damping = start.copy(), _FIRST_DAMPING
    residuals, jacobian = model(value)
    cost, weights = _loss(residuals, loss_px)
    for _ in range(_STEPS):
        weighted = diags(weights) @ jacobian
        normal = (jacobian.T @ weighted).toarray()
        gradient = np.asarray(weighted.T @ residuals)
        diagonal = np.maximum(np.diag(normal), 1e-12)
        while damping <= _MOST_DAMPING:
            try:
                factor = cho_factor(normal + np.diag(damping * diagonal))
                candidate = value - np.asarray(cho_solve(factor, gradient))
                tried, tried_jacobian = model(candidate)
                new_cost, new_weights = _loss(tried, loss_px)
            except LinAlgError:
                new_cost = np.inf
            if new_cost < cost:
                break
            damping *= 10.0
        else:
            return value
        gained = cost - new_cost
        value, residuals, jacobian = candidate, tried, tried_jacobian
        cost, weights = new_cost, new_weights
        damping = max(0.1 * damping, _LEAST_DAMPING)
        if gained <= _PROGRESS * cost:
            break
    return value


def _loss(residuals: FloatArray, loss_px: float | None) -> tuple[float, FloatArray]:
    """Cost of residuals (n,), and the weight (n,) of each in the normal equations."""
    squares = residuals * residuals
    if loss_px is None:
        return float(squares.sum()), np.ones_like(residuals)
    root = np.sqrt(1.0 + squares / loss_px**2)
    return float((2.0 * loss_px**2 * (root - 1.0)).sum()), 1.0 / root
