"""Base of every optimiser: the budget, the best point, invalid costs, the loop."""

from abc import ABC, abstractmethod
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.errors import SearchError
from markerless_tracker.geometry import FloatArray
from markerless_tracker.optim.problem import ParticleSet, Problem

Evaluate = Callable[..., FloatArray]
"""Costs (n,) of a batch of points (n, d); may take cutoff_costs (n,), see `Optimizer.run`."""


class Optimizer(ABC):
    """Minimises by alternating `ask` and `tell`.

    A subclass writes `_ask` (the points to evaluate next, (n, d)) and `_tell` (which uses their
    costs). This class counts evaluations, replaces non-finite costs by infinity and counts them,
    rejects points that are marked infeasible, and keeps the best.

    Attributes:
        problem: bounds, centre, sigma, feasibility, random source and budget.
        best_x: (d,) best point so far; the centre until one is found.
        best_cost: its cost; infinite until one is found.
        evaluations: points evaluated so far.
        bad_costs: number of points with a cost that was not finite.
    """

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self.best_x: FloatArray = problem.centre.copy()
        self.best_cost = np.inf
        self.evaluations = 0
        self.bad_costs = 0
        self._asked: FloatArray | None = None
        self._infeasible: NDArray[np.bool_] | None = None

    @property
    def estimate(self) -> FloatArray:
        """(d,) the estimate of the search: its best point, for most algorithms."""
        return self.best_x

    @property
    def particle_sd(self) -> FloatArray:
        """(d,) standard deviation of the particles, or of their own bests, in parameter units."""
        return np.zeros_like(self.best_x)

    @property
    def memory(self) -> ParticleSet | None:
        """Particles from which the next frame's search may start; None for most algorithms."""
        return None

    @property
    def finished(self) -> bool:
        """Whether the budget is spent."""
        return self.evaluations >= self.problem.particles * self.problem.iterations

    def ask(self) -> FloatArray:
        """Points (n, d) to evaluate next.

        Raises:
            SearchError: called twice without `tell`, or after the budget is spent.
        """
        if self._asked is not None or self.finished:
            raise SearchError(
                "ask() was called out of order: tell() the costs first, stop when finished"
            )
        self._asked, self._infeasible = self._ask()
        return self._asked

    def tell(self, costs: FloatArray) -> None:
        """Take the costs (n,) of the points returned by `ask`.

        Raises:
            SearchError: called out of order or with another number of costs.
        """
        if self._asked is None or self._infeasible is None or costs.shape != (len(self._asked),):
            raise SearchError(
                f"tell() got {costs.shape} costs for "
                f"{'no' if self._asked is None else len(self._asked)} points asked for"
            )
        points, self._asked = self._asked, None
        self.evaluations += len(points)
        costs = np.array(costs, dtype=np.float64)
        bad = ~np.isfinite(costs)
        self.bad_costs += int(bad.sum())
        costs[bad | self._infeasible] = np.inf
        best = int(np.argmin(costs))
        if costs[best] < self.best_cost:
            self.best_cost = float(costs[best])
            self.best_x = points[best].copy()
        self._tell(points, costs)

    @property
    def cutoff_costs(self) -> FloatArray | None:
        """Cutoff per point (n,): an evaluation may stop once its cost exceeds it; None = no cutoff.

        In a particle swarm a cost matters only if it is lower than the particle's own best.
        """
        return None

    def run(self, evaluate: Evaluate, *, early: bool = False) -> FloatArray:
        """Spend the budget; returns the estimate (d,).

        Args:
            evaluate: costs of points.
            early: whether to pass `cutoff_costs`, too. An evaluation may then stop once its cost
                exceeds its cutoff and return a lower bound. The result of the run is the same.
        """
        while not self.finished:
            points = self.ask()
            cutoff_costs = self.cutoff_costs if early else None
            self.tell(evaluate(points) if cutoff_costs is None else evaluate(points, cutoff_costs))
        return self.estimate

    @abstractmethod
    def _ask(self) -> tuple[FloatArray, NDArray[np.bool_]]:
        """Points (n, d), and which of them (n,) violate a constraint and cannot become the best."""

    @abstractmethod
    def _tell(self, points: FloatArray, costs: FloatArray) -> None:
        """Use the costs (n,) of the points (n, d); infinite for points that cannot be the best."""
