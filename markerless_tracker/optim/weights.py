"""Weighted particles: weights from costs, drawing by weight, the survival rate."""

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.geometry import FloatArray

SHARPEST = 1e5
_HALVINGS = 60


def weights_from_costs(costs: FloatArray, sharpness: float) -> FloatArray:
    """Weights (n,) ∝ exp(-sharpness · cost), their sum 1; particles of infinite cost get none.

    All zero if no cost is finite.
    """
    known = np.isfinite(costs)
    if not known.any():
        return np.zeros(costs.size)
    weights = np.zeros(costs.size)
    weights[known] = np.exp(-sharpness * (costs[known] - costs[known].min()))
    return np.asarray(weights / weights.sum())


def survival(weights: FloatArray) -> float:
    """Fraction of n particles that survive drawing by weight: (Σw)² / (n Σw²)."""
    return float(weights.sum() ** 2 / (weights.size * (weights**2).sum()))


def annealed_sharpness(costs: FloatArray, rate: float) -> float:
    """The sharpness β at which a fraction `rate` of the particles with finite costs (n,) survives.

    Found by bisection. If more survive even with `SHARPEST`, since all costs are nearly equal, β is
    1.
    """
    finite = costs[np.isfinite(costs)]
    if finite.size == 0 or survival(weights_from_costs(finite, SHARPEST)) > rate:
        return 1.0
    low, high = 0.0, SHARPEST
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        if survival(weights_from_costs(finite, middle)) > rate:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


def drawn_by_weight(weights: FloatArray, draws: FloatArray) -> NDArray[np.int64]:
    """Indices (m,) drawn with replacement by weight, from uniform draws (m,) in [0, 1)."""
    steps = np.cumsum(weights)
    at = np.searchsorted(steps, draws * steps[-1], side="right")
    return np.asarray(np.minimum(at, weights.size - 1), dtype=np.int64)
