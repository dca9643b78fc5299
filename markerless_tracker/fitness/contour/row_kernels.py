"""Normal equations of residuals in rows, elimination of unknowns, solution by Cholesky factors.

Compiled: rows are mostly zeros, and results do not depend on a library's number of threads.
"""

import numpy as np

from markerless_tracker.compiled import kernel
from markerless_tracker.geometry import FloatArray

_LEAST_PRECISION = 1e-9
"""Added to the precision of each parameter: without prior and residuals it does not change."""


def normal_equations(
    jacobian: FloatArray, weight: FloatArray, value: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """JᵀWJ (k, k) and JᵀWr (k,) of rows (n, k), their weights (n,) and residuals (n,)."""
    k = jacobian.shape[1]
    hessian, gradient = np.zeros((k, k)), np.zeros(k)
    used = np.empty(k, dtype=np.int64)
    _accumulate(np.ascontiguousarray(jacobian), weight, value, used, hessian, gradient)
    return hessian, gradient


def add_pose_prior(
    hessian: FloatArray,
    gradient: FloatArray,
    precision: FloatArray,
    off: FloatArray,
    *,
    damping: float,
) -> None:
    """Add a Gaussian prior of a pose, the first p unknowns, and damp their equations.

    Args:
        hessian, gradient: (p + k, p + k) and (p + k,), changed.
        precision: (p,) 1 / variance.
        off: (p,) the pose minus the prior's mean.
        damping: fraction of the diagonal that is added to it.
    """
    pose = np.arange(precision.size)
    hessian[pose, pose] = (hessian[pose, pose] + precision + _LEAST_PRECISION) * (1.0 + damping)
    gradient[pose] += precision * off


def eliminated(
    hessian: FloatArray,
    gradient: FloatArray,
    first: int,
    out_hessian: FloatArray,
    out_gradient: FloatArray,
) -> FloatArray:
    """Eliminate the first unknowns; add the reduced equations of the others (Schur complement).

    Args:
        hessian: (f + k, f + k), positive definite in its first f rows and columns.
        gradient: (f + k,).
        first: f.
        out_hessian, out_gradient: (k, k) and (k,), added to.

    Returns:
        (f, k + 1): matrix M; the step of the first unknowns is -M @ [step of the others, 1].
    """
    inner = np.concatenate([hessian[:first, first:], gradient[:first, None]], axis=1)
    _eliminate(hessian[:first, :first].copy(), inner)
    out_hessian += hessian[first:, first:]
    out_gradient += gradient[first:]
    _reduce(np.ascontiguousarray(hessian[:first, first:]), inner, out_hessian, out_gradient)
    return inner


def solved(hessian: FloatArray, gradient: FloatArray) -> FloatArray:
    """The step (k,) that solves positive definite equations (k, k) and (k,)."""
    step = -gradient[:, None]
    _eliminate(hessian.copy(), step)
    return step[:, 0]


@kernel
def _accumulate(jacobian, weight, value, used, hessian, gradient):  # type: ignore[no-untyped-def]
    """Add rows to hessian (k, k) and gradient (k,), as `normal_equations`; used (k,) is scratch."""
    n, k = jacobian.shape
    for i in range(n):
        count = 0
        for a in range(k):
            if jacobian[i, a] != 0.0:
                used[count] = a
                count += 1
        for p in range(count):
            a = used[p]
            scaled = weight[i] * jacobian[i, a]
            gradient[a] += scaled * value[i]
            for q in range(p + 1):
                hessian[a, used[q]] += scaled * jacobian[i, used[q]]
    for a in range(k):
        for b in range(a):
            hessian[b, a] = hessian[a, b]


@kernel
def _eliminate(a, right):  # type: ignore[no-untyped-def]
    """Replace right (f, m) by the solution of a (f, f) x = right; a becomes its Cholesky factor."""
    f, m = right.shape
    for i in range(f):
        for j in range(i + 1):
            total = a[i, j]
            for p in range(j):
                total -= a[i, p] * a[j, p]
            a[i, j] = np.sqrt(total) if i == j else total / a[j, j]
    for i in range(f):
        for p in range(i):
            for c in range(m):
                right[i, c] -= a[i, p] * right[p, c]
        for c in range(m):
            right[i, c] /= a[i, i]
    for i in range(f - 1, -1, -1):
        for p in range(i + 1, f):
            for c in range(m):
                right[i, c] -= a[p, i] * right[p, c]
        for c in range(m):
            right[i, c] /= a[i, i]


@kernel
def _reduce(cross, solved, hessian, gradient):  # type: ignore[no-untyped-def]
    """Subtract crossᵀ solved (k, k + 1) from hessian and gradient."""
    f, k = cross.shape
    for i in range(f):
        for a in range(k):
            for b in range(k):
                hessian[a, b] -= cross[i, a] * solved[i, b]
            gradient[a] -= cross[i, a] * solved[i, k]
