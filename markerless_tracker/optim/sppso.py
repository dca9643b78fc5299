"""One stage of SPPSO: particle swarm with constriction and growing acceleration.

Fleischmann, Austvoll, Kwolek: "Particle Swarm Optimization with Soft Search Space Partitioning for
Video-Based Markerless Pose Tracking", ACIVS 2012, Eqs 1-3 and the algorithm of section 3. The soft
partition itself, two such stages with their parameters and sigmas, is made in `tracking`.
"""

import math

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.compiled import compiled
from markerless_tracker.errors import SearchError
from markerless_tracker.geometry import FloatArray
from markerless_tracker.optim.base import Optimizer
from markerless_tracker.optim.problem import Problem
from markerless_tracker.optim.sampling import gaussian_sample
from markerless_tracker.optim.swarm import Rows, Swarm

UPDATES = ("iteration", "particle")


def acceleration(k: int, iterations: int) -> float:
    """c1(k) = c2(k) in iteration k = 2 .. iterations (Eq 2): from 2.05 to 2.15.

    With two iterations the slope is undefined and 2.05 is used.
    """
    if iterations <= 2:
        return 2.05
    return 0.1 / (iterations - 2) * (k - 2) + 2.05


def constriction(c: float) -> float:
    """χ for c1 = c2 = c (Eq 3), φ = 2c > 4."""
    phi = 2.0 * c
    return 2.0 / abs(2.0 - phi - math.sqrt(phi * phi - 4.0 * phi))


def constricted_step(
    x: FloatArray,
    v: FloatArray,
    best: FloatArray,
    leader: FloatArray,
    r1: FloatArray,
    r2: FloatArray,
    c: float,
    v_max: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Move particles once (the loop body of SPPSO's algorithm).

    v' = χ (v + c r1 (best - x) + c r2 (leader - x)), clamped to |v'| <= v_max; x' = x + v'.

    Args:
        x, v, best: (n, d) positions, velocities and own best positions.
        leader: (d,) best position of the swarm.
        r1, r2: (n, d) uniform draws.
        c: acceleration c1 = c2.
        v_max: (d,) greatest speed.

    Returns:
        The new positions and velocities, (n, d) each.
    """
    return _constricted_step(x, v, best, leader, r1, r2, c, constriction(c), v_max)  # type: ignore[no-any-return]


@compiled()
def _constricted_step(x, v, best, leader, r1, r2, c, chi, v_max):  # type: ignore[no-untyped-def]
    moved, there = np.empty(x.shape), np.empty(x.shape)
    for n in range(x.shape[0]):
        for i in range(x.shape[1]):
            own, all_ = best[n, i] - x[n, i], leader[i] - x[n, i]
            speed = chi * (v[n, i] + c * r1[n, i] * own + c * r2[n, i] * all_)
            speed = min(max(speed, -v_max[i]), v_max[i])
            moved[n, i] = speed
            there[n, i] = x[n, i] + speed
    return there, moved


class Sppso(Optimizer):
    """SPPSO's swarm.

    Every attempt to satisfy the constraints restarts from the particle's saved position and
    velocity with new draws. After the last failed attempt the particle moves nevertheless; it is
    evaluated and counted, but cannot become a best.

    Args:
        problem: the search.
        update: 'iteration' updates the swarm's best once per iteration, so that a whole iteration
            is evaluated in one batch; 'particle' updates it after every particle, as printed.

    Raises:
        SearchError: unknown `update`.
    """

    def __init__(self, problem: Problem, *, update: str = "iteration") -> None:
        super().__init__(problem)
        if update not in UPDATES:
            raise SearchError(f"update is {update!r}, expected one of {', '.join(UPDATES)}")
        self._batch = problem.particles if update == "iteration" else 1
        self._v_max = 2.0 * problem.sigma
        x = gaussian_sample(problem)
        self._swarm = Swarm(x, problem.rng.uniform(-1.0, 1.0, x.shape) * problem.sigma)
        self._iteration = 1
        self._next = 0

    @property
    def particle_sd(self) -> FloatArray:
        """(d,) standard deviation of the particles' own best positions."""
        return self._swarm.sd

    @property
    def cutoff_costs(self) -> FloatArray:
        """Each particle's own best cost; -inf for a particle that violates a constraint."""
        return self._swarm.cutoff_costs[self._rows]

    @property
    def _rows(self) -> slice:
        return slice(self._next, self._next + self._batch)

    def _ask(self) -> tuple[FloatArray, NDArray[np.bool_]]:
        swarm, rows = self._swarm, self._rows
        if self._iteration > 1:
            swarm.move(self.problem, self._step, rows, confined=False)
        return swarm.x[rows].copy(), swarm.infeasible[rows]

    def _step(self, rows: Rows) -> tuple[FloatArray, FloatArray]:
        swarm = self._swarm
        c = acceleration(self._iteration, self.problem.iterations)
        r1, r2 = self.problem.rng.random((2, rows.size, self.problem.centre.size))
        return constricted_step(
            swarm.x[rows], swarm.v[rows], swarm.best[rows], self.best_x, r1, r2, c, self._v_max
        )

    def _tell(self, points: FloatArray, costs: FloatArray) -> None:
        self._swarm.learn(costs, self._rows)
        self._next += len(points)
        if self._next == self.problem.particles:
            self._next = 0
            self._iteration += 1
