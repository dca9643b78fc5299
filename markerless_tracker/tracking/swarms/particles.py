"""Common parts of the compiled swarms: first positions, draws, moves under constraints, costs.

They equal `optim.sampling`, `optim.swarm` and `optim.base`, draw by draw.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.body.collision import are_feasible
from markerless_tracker.compiled import inlined, kernel
from markerless_tracker.fitness.raster.kernels import evaluate
from markerless_tracker.geometry import FloatArray
from markerless_tracker.optim.sampling import ATTEMPTS

# Literals would make numba compile the kernels once more.
_FIRST, _ONE = np.int64(0), np.int64(1)


class Particles(NamedTuple):
    """n particles in d parameters.

    Attributes:
        x, v, best: (n, d) positions, velocities, own best positions.
        best_costs: (n,) costs of the own best positions; infinite as long as unknown.
        infeasible: (n,) particles whose last move violates a constraint.
        proposed_x, proposed_v: (n, d) proposed positions and velocities.
        draws: (3 n d,) uniform draws of one attempt.
        todo: (n,) indices of the particles to be moved.
        good: (n,) whether a proposed position satisfies the constraints.
        cutoffs, costs: (n,) of the last evaluation.
        counts: (n, v, 4) of the last evaluation.
        found: (d,) best position of the swarm so far.
        found_cost: (1,) its cost.
    """

    x: FloatArray
    v: FloatArray
    best: FloatArray
    best_costs: FloatArray
    infeasible: NDArray[np.bool_]
    proposed_x: FloatArray
    proposed_v: FloatArray
    draws: FloatArray
    todo: NDArray[np.int64]
    good: NDArray[np.bool_]
    cutoffs: FloatArray
    costs: FloatArray
    counts: FloatArray
    found: FloatArray
    found_cost: FloatArray


def make_particles(count: int, centre: FloatArray, views: int) -> Particles:
    """Arrays for particles about a centre (d,), which is `found` at first."""
    d = centre.size
    return Particles(
        np.empty((count, d)), np.empty((count, d)), np.empty((count, d)), np.full(count, np.inf),
        np.zeros(count, dtype=np.bool_), np.empty((count, d)), np.empty((count, d)),
        np.empty(3 * count * d), np.empty(count, dtype=np.int64), np.empty(count, dtype=np.bool_),
        np.empty(count), np.empty(count), np.empty((count, views, 4)), centre.copy(),
        np.full(1, np.inf),
    )  # fmt: skip


@kernel
def take_all(particles, start, stop):  # type: ignore[no-untyped-def]
    """List the particles from start to stop in `todo`; returns their number."""
    for i in range(start, stop):
        particles.todo[i - start] = i
        particles.infeasible[i] = False
    return stop - start


@kernel
def draw(rng, particles, number):  # type: ignore[no-untyped-def]
    """Draw `number` uniform numbers in [0, 1)."""
    for i in range(number):
        particles.draws[i] = rng.random()


@kernel
def confine(particles, count, bounds):  # type: ignore[no-untyped-def]
    """Move proposed positions beyond the bounds (2, d) onto them; their velocity becomes 0."""
    for k in range(count):
        n = particles.todo[k]
        for i in range(bounds.shape[1]):
            proposed = particles.proposed_x[n, i]
            if proposed < bounds[0, i]:
                particles.proposed_x[n, i], particles.proposed_v[n, i] = bounds[0, i], 0.0
            elif proposed > bounds[1, i]:
                particles.proposed_x[n, i], particles.proposed_v[n, i] = bounds[1, i], 0.0


@kernel
def left_over(particles, count, constraints):  # type: ignore[no-untyped-def]
    """Keep, of the first `count` in `todo`, those whose proposed position violates a constraint."""
    kept = 0
    for k in range(count):
        n = particles.todo[k]
        are_feasible(particles.proposed_x[n : n + 1], constraints, particles.good[n : n + 1])
        if not particles.good[n]:
            particles.todo[kept] = n
            kept += 1
    return kept


@kernel
def place(particles, start, stop, count):  # type: ignore[no-untyped-def]
    """Move particles to their proposed positions; the first `count` in `todo` are infeasible."""
    for n in range(start, stop):
        for i in range(particles.x.shape[1]):
            particles.x[n, i] = particles.proposed_x[n, i]
            particles.v[n, i] = particles.proposed_v[n, i]
    for k in range(count):
        particles.infeasible[particles.todo[k]] = True


@kernel
def begin(rng, particles, centre, sigma, bounds, confined, constraints):  # type: ignore[no-untyped-def]
    """First positions and velocities, as `optim.sampling.gaussian_sample`."""
    n, d = particles.x.shape
    start = np.int64(0)
    count = take_all(particles, start, n)
    for _ in range(ATTEMPTS):
        for k in range(count):
            row = particles.todo[k]
            for i in range(d):
                particles.proposed_x[row, i] = centre[i] + sigma[i] * rng.standard_normal()
        if confined:
            confine(particles, count, bounds)
        count = left_over(particles, count, constraints)
        if count == 0:
            break
    for k in range(count):
        for i in range(d):
            particles.proposed_x[particles.todo[k], i] = centre[i]
    for row in range(n):
        for i in range(d):
            particles.proposed_v[row, i] = (-1.0 + 2.0 * rng.random()) * sigma[i]
    place(particles, start, n, start)
    for row in range(n):
        for i in range(d):
            particles.best[row, i] = particles.x[row, i]


@inlined
def learn(particles, start, stop, objective):  # type: ignore[no-untyped-def]
    """Evaluate the particles from start to stop; update their own bests and `found`.

    A particle's evaluation may stop when its cost exceeds that of its own best.
    """
    cutoffs, costs = particles.cutoffs, particles.costs
    for n in range(start, stop):
        cutoffs[n] = -np.inf if particles.infeasible[n] else particles.best_costs[n]
    evaluate(
        particles.x[start:stop], cutoffs[start:stop], objective, particles.counts[start:stop],
        costs[start:stop], _FIRST, _ONE,
    )  # fmt: skip
    best = start
    for n in range(start, stop):
        if particles.infeasible[n] or not np.isfinite(costs[n]):
            costs[n] = np.inf
        if costs[n] < costs[best]:
            best = n
    if costs[best] < particles.found_cost[0]:
        particles.found_cost[0] = costs[best]
        for i in range(particles.x.shape[1]):
            particles.found[i] = particles.x[best, i]
    for n in range(start, stop):
        if costs[n] < particles.best_costs[n]:
            particles.best_costs[n] = costs[n]
            for i in range(particles.x.shape[1]):
                particles.best[n, i] = particles.x[n, i]


@kernel
def leader(particles, start, stop):  # type: ignore[no-untyped-def]
    """Index of the particle from start to stop with the lowest own best cost."""
    best = start
    for n in range(start, stop):
        if particles.best_costs[n] < particles.best_costs[best]:
            best = n
    return best
