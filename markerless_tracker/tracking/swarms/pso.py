"""The swarm of HPSO, GLPSO and PSO, compiled: `optim.pso` over one stage of a frame."""

import numpy as np

from markerless_tracker.compiled import compiled, kernel
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
from markerless_tracker.tracking.swarms.search import SwarmSearch


def run_pso(
    search: SwarmSearch,
    *,
    inertia_max: float = 2.0,
    inertia_min: float = 0.1,
    acceleration: float = 2.05,
) -> Particles:
    """Run a stage; settings and errors as for `optim.Pso`."""
    check_inertia(inertia_max, inertia_min)
    particles = search.particles()
    steps = range(2, search.iterations + 1)
    inertias = [inertia(k, search.iterations, inertia_max, inertia_min) for k in steps]
    ends = np.array([0, search.count])
    _swarm(
        search.rng, particles, ends, np.array(inertias), acceleration, search.centre, search.sigma,
        search.bounds, search.constraints, search.objective,
    )  # fmt: skip
    return particles


@compiled(error_model="numpy")
def _swarm(  # type: ignore[no-untyped-def]
    rng, particles, ends, inertias, c, centre, sigma, bounds, constraints, objective
):
    """ends: (2,) as of `propose`."""
    start, count = np.int64(0), particles.x.shape[0]
    begin(rng, particles, centre, sigma, bounds, True, constraints)
    for k in range(inertias.size + 1):
        if k > 0:
            left = take_all(particles, start, count)
            for _ in range(ATTEMPTS):
                propose(rng, particles, left, ends, inertias[k - 1], c, sigma)
                confine(particles, left, bounds)
                left = left_over(particles, left, constraints)
                if left == 0:
                    break
            place(particles, start, count, left)
        learn(particles, start, count, objective)


@kernel
def propose(rng, particles, count, ends, w, c, sigma):  # type: ignore[no-untyped-def]
    """Propose moves of the first `count` particles in `todo`, as `optim.pso.inertia_step`.

    ends: (s + 1,) index of the first particle of each of s swarms, and n. Each swarm follows its
    own leader.
    """
    d = sigma.size
    draw(rng, particles, 2 * count * d)
    x, best = particles.x, particles.best
    swarm, first = -1, 0
    for k in range(count):
        n = particles.todo[k]
        while n >= ends[swarm + 1]:
            swarm += 1
            first = leader(particles, ends[swarm], ends[swarm + 1])
        for i in range(d):
            r1, r2 = particles.draws[k * d + i], particles.draws[(count + k) * d + i]
            speed = w * particles.v[n, i] + c * r1 * (best[n, i] - x[n, i])
            speed += c * r2 * (best[first, i] - x[n, i])
            speed = min(max(speed, -2.0 * sigma[i]), 2.0 * sigma[i])
            particles.proposed_v[n, i] = speed
            particles.proposed_x[n, i] = x[n, i] + speed
