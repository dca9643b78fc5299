"""Particle swarm with inertia: the swarm of H-MCPSO's sub-swarms, of HPSO and of plain PSO.

Saini et al.: "Markerless Human Motion Tracking Using Hierarchical Multi-Swarm Cooperative Particle
Swarm Optimization", PLoS ONE 10(5):e0127833, 2015, Eqs 1, 2, 6, 7; the inertia is that of John,
Trucco and Ivekovic, "Markerless human articulated tracking using hierarchical particle swarm
optimisation", 2010.

Readings [R]: Eqs 6-7 lack a logarithm, so that the inertia falls from 2.0 to 0.1 (`inertia`); no
clamp is printed, but without one the swarm diverges: |v| <= 2 sigma; particles stop at the bounds;
the first evaluation is iteration 1; moves into inter-penetration are drawn again as in SPPSO.
"""

import math

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.errors import SearchError
from markerless_tracker.geometry import FloatArray
from markerless_tracker.optim.base import Optimizer
from markerless_tracker.optim.problem import Problem
from markerless_tracker.optim.sampling import gaussian_sample
from markerless_tracker.optim.swarm import Rows, Swarm


def inertia(k: int, iterations: int, w_max: float, w_min: float) -> float:
    """ω of iteration k = 2 .. iterations: from w_max to w_min, exponentially (Eqs 6, 7).

    ω = w_max / e^c, where c grows in equal steps from 0 to ln(w_max / w_min), which is the paper's
    10 w_max with the logarithm that it lacks [R], w_min = 0.1. With two iterations it is w_max.
    """
    if iterations <= 2:
        return w_max
    c = math.log(w_max / w_min) * (k - 2) / (iterations - 2)
    return w_max / math.exp(c)


def inertia_step(
    x: FloatArray,
    v: FloatArray,
    best: FloatArray,
    leader: FloatArray,
    r1: FloatArray,
    r2: FloatArray,
    w: float,
    c: float,
    v_max: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Move particles once (Eqs 1, 2).

    v' = w v + c r1 (best - x) + c r2 (leader - x), clamped to |v'| <= v_max [R]; x' = x + v'.

    Args:
        x, v, best: (n, d) positions, velocities and own best positions.
        leader: (d,) or (n, d) best position of each particle's swarm.
        r1, r2: (n, d) uniform draws.
        w: inertia.
        c: acceleration φ1 = φ2.
        v_max: (d,) greatest speed.

    Returns:
        The new positions and velocities, (n, d) each.
    """
    moved = w * v + c * r1 * (best - x) + c * r2 * (leader - x)
    np.clip(moved, -v_max, v_max, out=moved)
    return x + moved, moved


def check_inertia(inertia_max: float, inertia_min: float) -> None:
    """Raise a SearchError unless 0 < inertia_min <= inertia_max."""
    if not 0.0 < inertia_min <= inertia_max:
        raise SearchError(
            f"inertia_min is {inertia_min:g}, expected above 0 and at most inertia_max, "
            f"{inertia_max:g}"
        )


class Pso(Optimizer):
    """One swarm; a whole iteration is evaluated in one batch.

    Args:
        problem: the search.
        inertia_max, inertia_min: inertia of the first and the last move.
        acceleration: φ1 = φ2.

    Raises:
        SearchError: the inertia would have to grow.
    """

    def __init__(
        self,
        problem: Problem,
        *,
        inertia_max: float = 2.0,
        inertia_min: float = 0.1,
        acceleration: float = 2.05,
    ) -> None:
        super().__init__(problem)
        check_inertia(inertia_max, inertia_min)
        self._inertia = (inertia_max, inertia_min)
        self._acceleration = acceleration
        self._v_max = 2.0 * problem.sigma
        x = gaussian_sample(problem, confined=True)
        self._swarm = Swarm(x, problem.rng.uniform(-1.0, 1.0, x.shape) * problem.sigma)
        self._iteration = 1

    @property
    def particle_sd(self) -> FloatArray:
        """(d,) standard deviation of the particles' own best positions."""
        return self._swarm.sd

    @property
    def cutoff_costs(self) -> FloatArray:
        """Each particle's own best cost."""
        return self._swarm.cutoff_costs

    def _ask(self) -> tuple[FloatArray, NDArray[np.bool_]]:
        if self._iteration > 1:
            self._swarm.move(self.problem, self._step)
        return self._swarm.x.copy(), self._swarm.infeasible

    def _step(self, rows: Rows) -> tuple[FloatArray, FloatArray]:
        swarm = self._swarm
        w = inertia(self._iteration, self.problem.iterations, *self._inertia)
        r1, r2 = self.problem.rng.random((2, rows.size, self.problem.centre.size))
        return inertia_step(
            swarm.x[rows], swarm.v[rows], swarm.best[rows], swarm.best[swarm.leader()],
            r1, r2, w, self._acceleration, self._v_max,
        )  # fmt: skip

    def _tell(self, points: FloatArray, costs: FloatArray) -> None:
        self._swarm.learn(costs)
        self._iteration += 1
