"""The state of a swarm: particles with velocities and own bests, moved under constraints."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.geometry import FloatArray
from markerless_tracker.optim.problem import Problem
from markerless_tracker.optim.sampling import ATTEMPTS

Rows = NDArray[np.int64]
Step = Callable[[Rows], tuple[FloatArray, FloatArray]]
"""New positions and velocities of given particles, with new draws at each call."""


def confine(x: FloatArray, v: FloatArray, bounds: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Move positions (n, d) beyond the bounds (2, d) onto them; their velocity becomes 0."""
    inside = np.clip(x, bounds[0], bounds[1])
    return inside, np.where(inside == x, v, 0.0)


class Swarm:
    """Positions, velocities and own bests of n particles.

    Attributes:
        x, v, best: (n, d) positions, velocities, best positions so far.
        best_costs: (n,) costs of the best positions; infinite as long as unknown.
        infeasible: (n,) particles whose last move violates a constraint.
    """

    def __init__(self, x: FloatArray, v: FloatArray) -> None:
        self.x, self.v, self.best = x.copy(), v.copy(), x.copy()
        self.best_costs = np.full(len(x), np.inf)
        self.infeasible = np.zeros(len(x), dtype=np.bool_)

    def move(
        self, problem: Problem, step: Step, rows: slice = np.s_[:], *, confined: bool = True
    ) -> None:
        """Move the particles of `rows`.

        A move that violates a constraint is tried again from the particle's position, with new
        draws, at most `ATTEMPTS` times. After the last attempt the particle moves nevertheless and
        is marked as infeasible.

        Args:
            problem: the search.
            step: proposes moves.
            rows: the particles to move.
            confined: whether particles beyond the bounds are moved onto them and stop.
        """
        x, v = self.x.copy(), self.v.copy()
        todo = np.arange(len(x))[rows]
        self.infeasible[rows] = False
        for _ in range(ATTEMPTS):
            moved = step(todo)
            x[todo], v[todo] = confine(*moved, problem.bounds) if confined else moved
            todo = todo[~problem.feasible(x[todo])]
            if todo.size == 0:
                break
        self.x, self.v = x, v
        self.infeasible[todo] = True

    @property
    def cutoff_costs(self) -> FloatArray:
        """(n,) own best costs; -inf for a particle that violates a constraint."""
        return np.where(self.infeasible, -np.inf, self.best_costs)

    @property
    def sd(self) -> FloatArray:
        """(d,) standard deviation of the own bests."""
        return np.asarray(self.best.std(axis=0))

    def learn(self, costs: FloatArray, rows: slice = np.s_[:]) -> None:
        """Update the own bests of the particles of `rows`, given their costs (n,)."""
        better = np.zeros(len(self.x), dtype=np.bool_)
        better[rows] = costs < self.best_costs[rows]
        self.best[better] = self.x[better]
        self.best_costs[better] = costs[better[rows]]

    def leader(self, start: int = 0, stop: int | None = None) -> int:
        """Index of the particle from start to stop with the lowest own best cost."""
        return start + int(np.argmin(self.best_costs[start:stop]))
