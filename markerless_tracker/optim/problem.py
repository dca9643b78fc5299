"""A search problem: bounds, first sample, budget, constraints and random source."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.errors import SearchError
from markerless_tracker.geometry import FloatArray

Feasible = Callable[[FloatArray], NDArray[np.bool_]]
"""Mask (n,) of the points (n, d) that satisfy the constraints."""


@dataclass(frozen=True, eq=False)
class ParticleSet:
    """Weighted particles about an estimate, as particle filters keep them between frames.

    Attributes:
        offsets: (n, d) particles minus the estimate that was made of them.
        weights: (n,) not negative, their sum is 1.
    """

    offsets: FloatArray
    weights: FloatArray


@dataclass(frozen=True, eq=False)
class Problem:
    """A search of d parameters.

    Attributes:
        bounds: (2, d) lower and upper bounds, infinite where free.
        centre: (d,) where the search starts.
        sigma: (d,) standard deviation of the first sample; velocities stay below twice it.
        particles, iterations: the budget is their product, the first sample being an iteration.
        feasible: constraints, bounds included.
        rng: the source of all random draws.
        memory: particles of the same search in the last frame, for algorithms that continue it.
    """

    bounds: FloatArray
    centre: FloatArray
    sigma: FloatArray
    particles: int
    iterations: int
    feasible: Feasible
    rng: np.random.Generator
    memory: ParticleSet | None = None

    def __post_init__(self) -> None:
        d = self.centre.size
        if self.bounds.shape != (2, d) or self.sigma.shape != (d,):
            raise SearchError(
                f"bounds {self.bounds.shape} and sigma {self.sigma.shape} "
                f"do not fit a centre of {d}"
            )
        if self.memory is not None and self.memory.offsets.shape != (self.memory.weights.size, d):
            raise SearchError(
                f"memory of shape {self.memory.offsets.shape} with {self.memory.weights.size} "
                f"weights does not fit a centre of {d}"
            )
        if np.any(self.bounds[0] > self.bounds[1]) or not np.all(self.sigma >= 0.0):
            raise SearchError("bounds must not cross and sigma must not be negative")
        if self.particles < 1 or self.iterations < 1:
            raise SearchError(
                f"{self.particles} particles x {self.iterations} iterations, "
                "expected at least 1 x 1"
            )


def everything_feasible(points: FloatArray) -> NDArray[np.bool_]:
    """All points are feasible: no constraint."""
    return np.ones(len(points), dtype=np.bool_)
