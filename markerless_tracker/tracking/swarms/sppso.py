"""The swarm of SPPSO, compiled: `optim.sppso` over one stage of a frame."""

import numpy as np

from markerless_tracker.compiled import compiled
from markerless_tracker.errors import SearchError
from markerless_tracker.optim.sampling import ATTEMPTS
from markerless_tracker.optim.sppso import UPDATES, acceleration, constriction
from markerless_tracker.tracking.swarms.particles import (
    Particles,
    begin,
    draw,
    learn,
    left_over,
    place,
    take_all,
)
from markerless_tracker.tracking.swarms.search import SwarmSearch


def run_sppso(search: SwarmSearch, *, update: str = "iteration") -> Particles:
    """Run a stage.

    Args:
        search: the stage.
        update: as for `optim.Sppso`.

    Raises:
        SearchError: unknown `update`.
    """
    if update not in UPDATES:
        raise SearchError(f"update is {update!r}, expected one of {', '.join(UPDATES)}")
    particles = search.particles()
    batch = search.count if update == "iteration" else 1
    accelerations = [acceleration(k, search.iterations) for k in range(2, search.iterations + 1)]
    _swarm(
        search.rng, particles, batch, np.array(accelerations),
        np.array([constriction(c) for c in accelerations]), search.centre, search.sigma,
        search.bounds, search.constraints, search.objective,
    )  # fmt: skip
    return particles


@compiled(error_model="numpy")
def _swarm(  # type: ignore[no-untyped-def]
    rng, particles, batch, accelerations, constrictions, centre, sigma, bounds, constraints,
    objective,
):  # fmt: skip
    """batch: number of particles after which the swarm's best is updated."""
    count = particles.x.shape[0]
    begin(rng, particles, centre, sigma, bounds, False, constraints)
    for k in range(accelerations.size + 1):
        for start in range(0, count, batch):
            if k > 0:
                left = take_all(particles, start, start + batch)
                for _ in range(ATTEMPTS):
                    _propose(
                        rng, particles, left, accelerations[k - 1], constrictions[k - 1], sigma
                    )
                    left = left_over(particles, left, constraints)
                    if left == 0:
                        break
                place(particles, start, start + batch, left)
            learn(particles, start, start + batch, objective)


@compiled(error_model="numpy")
def _propose(rng, particles, count, c, chi, sigma):  # type: ignore[no-untyped-def]
    """Propose moves of the first `count` particles in `todo`: `optim.sppso.constricted_step`."""
    d = sigma.size
    draw(rng, particles, 2 * count * d)
    x, best, found = particles.x, particles.best, particles.found
    for k in range(count):
        n = particles.todo[k]
        for i in range(d):
            r1, r2 = particles.draws[k * d + i], particles.draws[(count + k) * d + i]
            own, all_ = best[n, i] - x[n, i], found[i] - x[n, i]
            speed = chi * (particles.v[n, i] + c * r1 * own + c * r2 * all_)
            speed = min(max(speed, -2.0 * sigma[i]), 2.0 * sigma[i])
            particles.proposed_v[n, i] = speed
            particles.proposed_x[n, i] = x[n, i] + speed
