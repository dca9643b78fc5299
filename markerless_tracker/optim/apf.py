"""Annealed particle filter.

Deutscher and Reid: "Articulated body motion capture by stochastic search", IJCV 2005, as in Sigal,
Balan and Black, "HumanEva", IJCV 2010: layers m = M .. 1; each draws with replacement by weight,
adds N(0, α^(M-m) Σ) and weighs by p^β_m, β_m such that about half of the particles survive. The top
layer starts from the last frame's layer 1. log p is minus the cost.

Readings [R]: particles that break a constraint are rejected, not drawn again, and count as
evaluated. Ours: the last frame's particles are kept relative to their estimate, so that they follow
when prediction or refinement moves it; the survival rate counts particles that were not rejected; β
is searched up to 1e5, and 1 if that is not enough.
"""

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.errors import SearchError
from markerless_tracker.geometry import FloatArray
from markerless_tracker.optim.base import Optimizer
from markerless_tracker.optim.problem import ParticleSet, Problem
from markerless_tracker.optim.weights import (
    annealed_sharpness,
    drawn_by_weight,
    weights_from_costs,
)

ESTIMATES = ("mean", "best")


def diffused(
    particles: FloatArray, chosen: NDArray[np.int64], noise: FloatArray, sigma: FloatArray
) -> FloatArray:
    """The chosen (n,) of the particles (k, d), moved by normal draws (n, d) times sigma."""
    return np.asarray(particles[chosen] + sigma * noise)


def layer_sigma(sigma: FloatArray, layer: int, layers: int, shrink: float) -> FloatArray:
    """Sigma (d,) of the noise of layer m = layers .. 1: of variance shrink^(layers - m) sigma²."""
    return np.asarray(sigma * shrink ** (0.5 * (layers - layer)))


class Apf(Optimizer):
    """Layers are the problem's iterations; each is evaluated in one batch.

    Args:
        problem: the search.
        survival: fraction of the particles that survives a layer.
        shrink: α, factor of the noise's variance from layer to layer.
        estimate: 'mean': weighted mean of the last layer, unless that breaks a constraint; 'best':
            the best point.

    Raises:
        SearchError: an unknown estimate.
    """

    def __init__(
        self,
        problem: Problem,
        *,
        survival: float = 0.5,
        shrink: float = 0.5,
        estimate: str = "mean",
    ) -> None:
        super().__init__(problem)
        if estimate not in ESTIMATES:
            raise SearchError(f"estimate is {estimate!r}, expected one of {', '.join(ESTIMATES)}")
        self._survival, self._shrink, self._mean = survival, shrink, estimate == "mean"
        if problem.memory is None:
            self._particles, self._weights = problem.centre[None].copy(), np.ones(1)
        else:
            self._particles = problem.centre + problem.memory.offsets
            self._weights = problem.memory.weights
        self._layer = problem.iterations

    @property
    def estimate(self) -> FloatArray:
        """(d,) the configured estimate; the best point if a mean is not feasible."""
        if self._mean and np.isfinite(self.best_cost):
            mean = self._weights @ self._particles
            if self.problem.feasible(mean[None])[0]:
                return np.asarray(mean)
        return self.best_x

    @property
    def particle_sd(self) -> FloatArray:
        """(d,) standard deviation of the last layer's particles, weighted."""
        around = self._particles - self._weights @ self._particles
        return np.asarray(np.sqrt(self._weights @ around**2))

    @property
    def memory(self) -> ParticleSet:
        """Particles and weights of the last layer, relative to the estimate."""
        return ParticleSet(self._particles - self.estimate, self._weights)

    def _sharpness(self, costs: FloatArray) -> float:
        return annealed_sharpness(costs, self._survival)

    def _ask(self) -> tuple[FloatArray, NDArray[np.bool_]]:
        problem = self.problem
        n = problem.particles
        chosen = drawn_by_weight(self._weights, problem.rng.random(n))
        noise = problem.rng.standard_normal((n, problem.centre.size))
        sigma = layer_sigma(problem.sigma, self._layer, problem.iterations, self._shrink)
        points = diffused(self._particles, chosen, noise, sigma)
        return points, ~problem.feasible(points)

    def _tell(self, points: FloatArray, costs: FloatArray) -> None:
        self._layer -= 1
        # A layer without any particle of finite cost is skipped.
        if np.isfinite(costs).any():
            self._particles = points.copy()
            self._weights = weights_from_costs(costs, self._sharpness(costs))
