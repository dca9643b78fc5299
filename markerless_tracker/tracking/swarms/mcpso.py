"""H-MCPSO's and MCPSO's swarms, compiled: `optim.mcpso` over one stage of a frame.

The sub-swarms' particles come first, one sub-swarm after the other, then the master's.
"""

import numpy as np

from markerless_tracker.compiled import compiled, kernel
from markerless_tracker.errors import SearchError
from markerless_tracker.optim.mcpso import MASTER_TERMS, swarm_sizes
from markerless_tracker.optim.pso import check_inertia, inertia
from markerless_tracker.optim.sampling import ATTEMPTS
from markerless_tracker.tracking.swarms.particles import (
    Particles,
    begin,
    confine,
    draw,
    leader,
    learn,
    left_over,
    place,
    take_all,
)
from markerless_tracker.tracking.swarms.pso import propose
from markerless_tracker.tracking.swarms.search import SwarmSearch


def run_mcpso(
    search: SwarmSearch,
    *,
    sub_swarms: int = 3,
    inertia_max: float = 2.0,
    inertia_min: float = 0.1,
    acceleration: float = 2.05,
    migration: float = 2.0,
    master_term: str = "printed",
) -> Particles:
    """Run a stage; settings and errors as for `optim.Mcpso`."""
    if master_term not in MASTER_TERMS:
        raise SearchError(
            f"master_term is {master_term!r}, expected one of {', '.join(MASTER_TERMS)}"
        )
    check_inertia(inertia_max, inertia_min)
    particles = search.particles()
    *sizes, master = swarm_sizes(search.count, sub_swarms)
    ends = np.cumsum([0, *sizes, master])
    steps = range(2, search.iterations + 1)
    inertias = [inertia(k, search.iterations, inertia_max, inertia_min) for k in steps]
    _swarms(
        search.rng, particles, ends, np.array(inertias), acceleration, migration,
        master_term == "weighted", search.centre, search.sigma, search.bounds, search.constraints,
        search.objective,
    )  # fmt: skip
    return particles


@compiled(error_model="numpy")
def _swarms(  # type: ignore[no-untyped-def]
    rng, particles, ends, inertias, c, c_sub, weighted, centre, sigma, bounds, constraints,
    objective,
):  # fmt: skip
    """ends: (s + 2,) first particle of each of the s sub-swarms and of the master, and n."""
    first, subs, count = np.int64(0), ends[-2], ends[-1]
    begin(rng, particles, centre, sigma, bounds, True, constraints)
    learn(particles, first, count, objective)
    for k in range(inertias.size):
        left = take_all(particles, first, subs)
        for _ in range(ATTEMPTS):
            propose(rng, particles, left, ends, inertias[k], c, sigma)
            confine(particles, left, bounds)
            left = left_over(particles, left, constraints)
            if left == 0:
                break
        place(particles, first, subs, left)
        learn(particles, first, subs, objective)
        phi = _migrate(particles, ends)
        weight = phi if weighted else 1.0
        left = take_all(particles, subs, count)
        for _ in range(ATTEMPTS):
            _propose_master(
                rng, particles, left, subs, inertias[k], c, weight * c, (1.0 - phi) * c_sub, sigma
            )
            confine(particles, left, bounds)
            left = left_over(particles, left, constraints)
            if left == 0:
                break
        place(particles, subs, count, left)
        learn(particles, subs, count, objective)


@kernel
def _propose_master(rng, particles, count, subs, w, c, c_own, c_sub, sigma):  # type: ignore[no-untyped-def]
    """Propose moves of the master's first `count` in `todo`, as `optim.mcpso.master_step`."""
    d = sigma.size
    draw(rng, particles, 3 * count * d)
    x, best, draws = particles.x, particles.best, particles.draws
    own, other = leader(particles, subs, x.shape[0]), leader(particles, 0, subs)
    for k in range(count):
        n = particles.todo[k]
        for i in range(d):
            at = k * d + i
            speed = w * particles.v[n, i] + c * draws[at] * (best[n, i] - x[n, i])
            speed += c_own * draws[count * d + at] * (best[own, i] - x[n, i])
            speed += c_sub * draws[2 * count * d + at] * (best[other, i] - x[n, i])
            speed = min(max(speed, -2.0 * sigma[i]), 2.0 * sigma[i])
            particles.proposed_v[n, i] = speed
            particles.proposed_x[n, i] = x[n, i] + speed


@kernel
def _migrate(particles, ends):  # type: ignore[no-untyped-def]
    """The migration factor; then the sub-swarms' bests enter the master, as in `optim.mcpso`."""
    subs, count = ends[-2], ends[-1]
    costs, best, x = particles.best_costs, particles.best, particles.x
    sub_cost = costs[leader(particles, 0, subs)]
    master_cost = costs[leader(particles, subs, count)]
    phi = 0.5
    if sub_cost < master_cost:
        phi = 0.0
    elif master_cost < sub_cost:
        phi = 1.0
    for swarm in range(ends.size - 2):
        fittest = leader(particles, ends[swarm], ends[swarm + 1])
        worst = subs
        for n in range(subs, count):
            if costs[n] > costs[worst]:
                worst = n
        if costs[fittest] < costs[worst]:
            costs[worst] = costs[fittest]
            for i in range(x.shape[1]):
                x[worst, i] = best[worst, i] = best[fittest, i]
    return phi
