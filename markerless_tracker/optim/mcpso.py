"""Multi-swarm cooperative particle swarm: sub-swarms, and a master that their best attracts.

Saini et al., PLoS ONE 10(5):e0127833, 2015, Eqs 1-7 and Algorithm 1, after Niu et al., "MCPSO: A
multi-swarm cooperative particle swarm optimizer", 2007. H-MCPSO is this swarm in each of its
hierarchical steps, MCPSO this swarm on the whole body; the steps are made in `tracking`.

Readings [R], besides those of `pso`: the fitness is a cost, so "greater" in Eq 5 reads "worse" and
the better sub-swarm attracts (`migration_factor`); the migration factor is found before the
sub-swarms' bests enter the master; each best replaces the master's worst particle if it is better,
position, own best and cost, the velocity stays, and nothing is evaluated for it; Eq 4 uses the new
velocity; Eq 3 as printed, with a switch for MCPSO's form as it is recalled.
"""

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.errors import SearchError
from markerless_tracker.geometry import FloatArray
from markerless_tracker.optim.base import Optimizer
from markerless_tracker.optim.problem import Problem
from markerless_tracker.optim.pso import check_inertia, inertia, inertia_step
from markerless_tracker.optim.sampling import gaussian_sample
from markerless_tracker.optim.swarm import Rows, Swarm

MASTER_TERMS = ("printed", "weighted")


def better(a: float, b: float) -> bool:
    """Whether cost a beats cost b."""
    return a < b


def migration_factor(sub_cost: float, master_cost: float) -> float:
    """ϕ of Eq 5: 0 if the sub-swarms' best beats the master's, 0.5 if they are equal, else 1."""
    if better(sub_cost, master_cost):
        return 0.0
    return 1.0 if better(master_cost, sub_cost) else 0.5


def swarm_sizes(particles: int, sub_swarms: int) -> tuple[int, ...]:
    """Particles of each sub-swarm, then of the master; as equal as possible.

    Table 4 of the paper at 20 particles: 7 7 6, 5 5 5 5, 4 4 4 4 4, 3 3 3 3 3 5 [R].

    Raises:
        SearchError: there are too few particles.
    """
    if sub_swarms < 1 or particles <= sub_swarms:
        raise SearchError(
            f"{particles} particles for {sub_swarms} sub-swarms and a master, expected at least "
            f"one each and at least one sub-swarm"
        )
    size = max(1, round(particles / (sub_swarms + 1)))
    if sub_swarms * size >= particles:
        size = (particles - 1) // sub_swarms
    return (*[size] * sub_swarms, particles - sub_swarms * size)


def master_step(
    x: FloatArray,
    v: FloatArray,
    best: FloatArray,
    leader: FloatArray,
    sub_leader: FloatArray,
    draws: FloatArray,
    w: float,
    c: float,
    c_sub: float,
    phi: float,
    v_max: FloatArray,
    *,
    master_weight: float = 1.0,
) -> tuple[FloatArray, FloatArray]:
    """Move the master's particles once (Eqs 3, 4).

    v' = w v + c r1 (best - x) + c r2 (leader - x) + (1 - ϕ) c_sub r3 (sub_leader - x), clamped to
    |v'| <= v_max [R]; x' = x + v'.

    Args:
        x, v, best: (n, d) positions, velocities and own best positions.
        leader, sub_leader: (d,) best positions of the master and of all sub-swarms.
        draws: (3, n, d) uniform draws r1, r2, r3.
        w: inertia.
        c, c_sub: accelerations φ1 = φ2, and φ3.
        phi: migration factor ϕ.
        v_max: (d,) greatest speed.
        master_weight: factor of the leader's term.

    Returns:
        The new positions and velocities, (n, d) each.
    """
    r1, r2, r3 = draws
    moved = w * v + c * r1 * (best - x) + master_weight * c * r2 * (leader - x)
    moved += (1.0 - phi) * c_sub * r3 * (sub_leader - x)
    np.clip(moved, -v_max, v_max, out=moved)
    return x + moved, moved


class Mcpso(Optimizer):
    """Sub-swarms, evaluated together in one batch, then the master, in every iteration.

    The first iteration evaluates the first positions of all particles in one batch.

    Args:
        problem: the search; `swarm_sizes` distributes its particles.
        sub_swarms: number of sub-swarms.
        inertia_max, inertia_min: inertia of the first and the last move.
        acceleration: φ1 = φ2.
        migration: φ3.
        master_term: 'printed': Eq 3; 'weighted': the migration factor also multiplies the term of
            the master's best.

    Raises:
        SearchError: too few particles, an unknown term, or an inertia that would have to grow.
    """

    def __init__(
        self,
        problem: Problem,
        *,
        sub_swarms: int = 3,
        inertia_max: float = 2.0,
        inertia_min: float = 0.1,
        acceleration: float = 2.05,
        migration: float = 2.0,
        master_term: str = "printed",
    ) -> None:
        super().__init__(problem)
        check_inertia(inertia_max, inertia_min)
        if master_term not in MASTER_TERMS:
            raise SearchError(
                f"master_term is {master_term!r}, expected one of {', '.join(MASTER_TERMS)}"
            )
        self._inertia = (inertia_max, inertia_min)
        self._accelerations = (acceleration, migration)
        self._weighted = master_term == "weighted"
        self._v_max = 2.0 * problem.sigma
        *sizes, _ = swarm_sizes(problem.particles, sub_swarms)
        ends = np.cumsum([0, *sizes])
        self._spans = tuple(zip(ends[:-1].tolist(), ends[1:].tolist(), strict=True))
        self._swarm_of = np.repeat(np.arange(sub_swarms), sizes)
        x = gaussian_sample(problem, confined=True)
        v = problem.rng.uniform(-1.0, 1.0, x.shape) * problem.sigma
        self._subs = Swarm(x[: ends[-1]], v[: ends[-1]])
        self._master = Swarm(x[ends[-1] :], v[ends[-1] :])
        self._iteration = 1
        self._subs_next = True
        self._phi = 0.5

    @property
    def particle_sd(self) -> FloatArray:
        """(d,) standard deviation of all particles' own best positions, the master's included."""
        return np.asarray(np.concatenate([self._subs.best, self._master.best]).std(axis=0))

    @property
    def cutoff_costs(self) -> FloatArray:
        """Own best cost of each particle returned by `ask`."""
        if self._iteration == 1:
            return np.concatenate([self._subs.cutoff_costs, self._master.cutoff_costs])
        return (self._subs if self._subs_next else self._master).cutoff_costs

    def _ask(self) -> tuple[FloatArray, NDArray[np.bool_]]:
        if self._iteration == 1:
            x = np.concatenate([self._subs.x, self._master.x])
            return x, np.zeros(len(x), dtype=np.bool_)
        if self._subs_next:
            moving = self._subs
            moving.move(self.problem, self._sub_step)
        else:
            moving = self._master
            moving.move(self.problem, self._master_step)
        return moving.x.copy(), moving.infeasible

    def _sub_step(self, rows: Rows) -> tuple[FloatArray, FloatArray]:
        subs = self._subs
        leaders = subs.best[[subs.leader(*span) for span in self._spans]]
        r1, r2 = self.problem.rng.random((2, rows.size, self.problem.centre.size))
        return inertia_step(
            subs.x[rows], subs.v[rows], subs.best[rows], leaders[self._swarm_of[rows]],
            r1, r2, self._w, self._accelerations[0], self._v_max,
        )  # fmt: skip

    def _master_step(self, rows: Rows) -> tuple[FloatArray, FloatArray]:
        master, subs = self._master, self._subs
        draws = self.problem.rng.random((3, rows.size, self.problem.centre.size))
        return master_step(
            master.x[rows], master.v[rows], master.best[rows],
            master.best[master.leader()], subs.best[subs.leader()], draws,
            self._w, *self._accelerations, self._phi, self._v_max,
            master_weight=self._phi if self._weighted else 1.0,
        )  # fmt: skip

    @property
    def _w(self) -> float:
        return inertia(self._iteration, self.problem.iterations, *self._inertia)

    def _tell(self, points: FloatArray, costs: FloatArray) -> None:
        if self._iteration == 1:
            subs = len(self._subs.x)
            self._subs.learn(costs[:subs])
            self._master.learn(costs[subs:])
            self._iteration = 2
        elif self._subs_next:
            self._subs.learn(costs)
            self._subs_next = False
            self._migrate()
        else:
            self._master.learn(costs)
            self._subs_next = True
            self._iteration += 1

    def _migrate(self) -> None:
        """Find the migration factor; then replace the master's worst by the sub-swarms' bests."""
        subs, master = self._subs, self._master
        self._phi = migration_factor(float(subs.best_costs.min()), float(master.best_costs.min()))
        for span in self._spans:
            fittest = subs.leader(*span)
            worst = int(np.argmax(master.best_costs))
            if better(subs.best_costs[fittest], master.best_costs[worst]):
                master.x[worst] = master.best[worst] = subs.best[fittest]
                master.best_costs[worst] = subs.best_costs[fittest]
