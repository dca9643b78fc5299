"""Damped Gauss-Newton with Gaussian priors, bounds, and a truncation that shrinks.

It is made for robust least squares whose normal equations the caller sums, such as contour
refinement. The step is compiled, so that its result does not depend on a library's number of
threads, and it can be part of a compiled loop.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.compiled import kernel
from markerless_tracker.errors import SearchError
from markerless_tracker.geometry import FloatArray

Equations = Callable[[FloatArray, float], tuple[FloatArray, FloatArray]]
"""At a point (p,) and a truncation: JᵀWJ (p, p) and JᵀWr (p,), in units of the data's precision."""

DAMPING = 1e-3
"""Fraction of its diagonal that is added to JᵀWJ."""
SOLVED, SINGULAR, NOT_FINITE = 0, 1, 2
"""Outcomes of a step."""
_STATES = ("solved", "singular", "not finite")
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


class StepScratch(NamedTuple):
    """Working memory of `solve_step` for p parameters."""

    factor: FloatArray  # (p, p)
    right: FloatArray  # (p,)
    step: FloatArray  # (p,), the result
    side: NDArray[np.int64]  # (p,) -1 and 1: held on the lower and the upper bound; 0: free
    free: NDArray[np.int64]  # (p,)


def make_step_scratch(parameters: int) -> StepScratch:
    """Allocate working memory."""
    p = parameters
    return StepScratch(
        np.empty((p, p)), np.empty(p), np.empty(p), np.empty(p, np.int64), np.empty(p, np.int64)
    )


def damped_step(
    hessian: FloatArray, gradient: FloatArray, x: FloatArray, bounds: FloatArray, damping: float
) -> FloatArray:
    """The step (p,) of (H + damping diag H) step = -gradient, with x + step within bounds (2, p).

    Parameters that a solution would take out of bounds are held on them, and the others are solved
    again. Held parameters that the gradient pulls back inside are released (primal-dual active
    sets, Hintermüller, Ito and Kunisch 2002).

    Raises:
        SearchError: the equations are singular or not finite.
    """
    scratch = make_step_scratch(x.size)
    state = solve_step(
        np.array(hessian, dtype=np.float64), np.ascontiguousarray(gradient, dtype=np.float64), x,
        np.ascontiguousarray(bounds, dtype=np.float64), damping, scratch,
    )  # fmt: skip
    if state != SOLVED:
        raise SearchError(f"contour refinement: the normal equations are {_STATES[state]}")
    return scratch.step


@kernel
def solve_step(hessian, gradient, x, bounds, damping, scratch):  # type: ignore[no-untyped-def]
    """Fill scratch.step with the step of `damped_step`; the hessian's diagonal is damped in place.

    Returns:
        SOLVED, or why there is no step: SINGULAR or NOT_FINITE.
    """
    size = x.size
    step, side = scratch.step, scratch.side
    finite = True
    for i in range(size):
        hessian[i, i] += damping * hessian[i, i] + 1e-12
        side[i] = 0
        finite = finite and np.isfinite(gradient[i])
        for j in range(size):
            finite = finite and np.isfinite(hessian[i, j])
    if not finite:
        return NOT_FINITE
    for _ in range(_ACTIVE_SETS + 1):
        if not _solve_free(hessian, gradient, x, bounds, scratch):
            return SINGULAR
        same, held = True, False
        for i in range(size):
            pull = 0.0
            if side[i] != 0:
                pull = -gradient[i]
                for j in range(size):
                    pull -= hessian[i, j] * step[j]
            now = 0
            if step[i] < bounds[0, i] - x[i] or (side[i] < 0 and pull < 0.0):
                now = -1
            elif step[i] > bounds[1, i] - x[i] or (side[i] > 0 and pull > 0.0):
                now = 1
            same = same and now == side[i]
            held = held or now != 0
            side[i] = now
        if same or not held:
            break
    for i in range(size):
        if not np.isfinite(step[i]):
            return NOT_FINITE
        step[i] = min(max(x[i] + step[i], bounds[0, i]), bounds[1, i]) - x[i]
    return SOLVED


@kernel
def _solve_free(hessian, gradient, x, bounds, scratch):  # type: ignore[no-untyped-def]
    """Solve for the free parameters, the others on their bounds; False if they are singular.

    By a Cholesky factor whose inner loops run along rows, so that they are vectorised.
    """
    factor, right, step = scratch.factor, scratch.right, scratch.step
    side, free = scratch.side, scratch.free
    n = 0
    for i in range(x.size):
        if side[i] == 0:
            free[n] = i
            n += 1
        else:
            step[i] = (bounds[0, i] if side[i] < 0 else bounds[1, i]) - x[i]
    for r in range(n):
        i = free[r]
        total = -gradient[i]
        if n < x.size:
            for j in range(x.size):
                if side[j] != 0:
                    total -= hessian[i, j] * step[j]
        right[r] = total
        for c in range(r, n):
            factor[r, c] = hessian[i, free[c]]
    for k in range(n):
        if not factor[k, k] > 0.0:
            return False
        inverse = 1.0 / np.sqrt(factor[k, k])
        for c in range(k, n):
            factor[k, c] *= inverse
        right[k] *= inverse
        for r in range(k + 1, n):
            share = factor[k, r]
            right[r] -= share * right[k]
            for c in range(r, n):
                factor[r, c] -= share * factor[k, c]
    for k in range(n - 1, -1, -1):
        total = right[k]
        for c in range(k + 1, n):
            total -= factor[k, c] * right[c]
        right[k] = total / factor[k, k]
        step[free[k]] = right[k]
    return True


def truncations(first: float, last: float, iterations: int) -> FloatArray:
    """Truncation (iterations,) of each step: from the first to the last, geometrically."""
    part = np.arange(iterations) / (iterations - 1) if iterations > 1 else np.ones(iterations)
    return np.asarray(first * (last / first) ** part)


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
        start: (p,) initial point.
        priors: added to the data's equations.
        bounds: (2, p) of the point.
        iterations: number of steps; the truncation shrinks geometrically over them.
        truncation: residuals beyond it are outliers, in the first and in the last step.

    Returns:
        The refined point (p,). A step whose equations cannot be solved ends the refinement.
    """
    x = np.clip(start, bounds[0], bounds[1])
    for bound in truncations(*truncation, iterations):
        hessian, gradient = equations(x, float(bound))
        hessian, gradient = hessian.copy(), gradient.copy()
        for prior in priors:
            hessian[np.diag_indices_from(hessian)] += prior.precision
            gradient += prior.precision * (x - prior.mean)
        try:
            step = damped_step(hessian, gradient, x, bounds, DAMPING)
        except SearchError:
            return x
        # Rounding may put the sum beyond a bound.
        x = np.clip(x + step, bounds[0], bounds[1])
    return x
