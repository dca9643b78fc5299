"""Damped Gauss-Newton with Gaussian priors, bounds, and a truncation that shrinks.

For robust least squares whose normal equations the caller sums: contour refinement.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from markerless_tracker.errors import SearchError
from markerless_tracker.geometry import FloatArray

Equations = Callable[[FloatArray, float], tuple[FloatArray, FloatArray]]
"""At a point (p,) and a truncation: JᵀWJ (p, p) and JᵀWr (p,), in units of the data's precision."""

_DAMPING = 1e-3
_ACTIVE_SETS = 10


@dataclass(frozen=True, eq=False)
class Prior:
    """A Gaussian prior of each parameter.

    Attributes:
        mean: (p,).
        precision: (p,) 1 / variance; 0 = no prior.
    """

    mean: FloatArray
    precision: FloatArray


def damped_step(
    hessian: FloatArray, slope: FloatArray, x: FloatArray, bounds: FloatArray, damping: float
) -> FloatArray:
    """The step (p,) of (H + damping diag H) step = -slope that keeps x + step within bounds (2, p).

    Parameters that a solution would take out of bounds are held on them and the rest is solved
    again; those that the slope there pulls back inside are released (primal-dual active sets,
    Hintermüller, Ito and Kunisch 2002).

    Raises:
        SearchError: the equations are singular or not finite.
    """
    a = hessian + np.diag(damping * np.diag(hessian) + 1e-12)
    low, high = bounds[0] - x, bounds[1] - x
    if not (np.isfinite(a).all() and np.isfinite(slope).all()):
        raise SearchError("contour refinement: the normal equations are not finite")
    try:
        step = np.linalg.solve(a, -slope)
        below, above = step < low, step > high
        for _ in range(_ACTIVE_SETS):
            held = below | above
            if not held.any():
                break
            free = ~held
            step[held] = np.where(below, low, high)[held]
            right = -slope[free] - a[np.ix_(free, held)] @ step[held]
            step[free] = np.linalg.solve(a[np.ix_(free, free)], right)
            pull = -(a @ step + slope)
            still_below = (step < low) | (below & (pull < 0.0))
            still_above = (step > high) | (above & (pull > 0.0))
            if (still_below == below).all() and (still_above == above).all():
                break
            below, above = still_below, still_above
    except np.linalg.LinAlgError as error:
        raise SearchError("contour refinement: the normal equations are singular") from error
    if not np.isfinite(step).all():
        raise SearchError("contour refinement: the step is not finite")
    return np.asarray(np.clip(x + step, bounds[0], bounds[1]) - x)


def refine(
    equations: Equations,
    start: FloatArray,
    *,
    priors: tuple[Prior, ...],
    bounds: FloatArray,
    iterations: int,
    truncation: tuple[float, float],
) -> FloatArray:
    """Refine a point (p,) by a fixed number of damped Gauss-Newton steps.

    Args:
        equations: the data's normal equations.
        start: (p,) where to begin.
        priors: added to the data's equations.
        bounds: (2, p), kept.
        iterations: number of steps; the truncation shrinks geometrically over them.
        truncation: residuals beyond it are outliers, in the first and in the last step.

    Returns:
        The refined point (p,). A step whose equations cannot be solved ends the refinement.
    """
    x = np.clip(start, bounds[0], bounds[1])
    for i in range(iterations):
        part = i / (iterations - 1) if iterations > 1 else 1.0
        hessian, slope = equations(x, truncation[0] * (truncation[1] / truncation[0]) ** part)
        hessian, slope = hessian.copy(), slope.copy()
        for prior in priors:
            hessian[np.diag_indices_from(hessian)] += prior.precision
            slope += prior.precision * (x - prior.mean)
        try:
            step = damped_step(hessian, slope, x, bounds, _DAMPING)
        except SearchError:
            return x
        # A sum may round to beyond a bound.
        x = np.clip(x + step, bounds[0], bounds[1])
    return x
