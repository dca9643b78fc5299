"""First samples of a swarm, under constraints."""

import numpy as np

from markerless_tracker.geometry import FloatArray
from markerless_tracker.optim.problem import Problem

ATTEMPTS = 10
"""Number of attempts to draw or move a particle that violates a constraint (SPPSO, section 3)."""


def gaussian_sample(problem: Problem, *, confined: bool = False) -> FloatArray:
    """Positions (n, d) drawn from N(centre, diag(sigma²)) (SPPSO Eq 1).

    A particle that violates a constraint is drawn again, at most `ATTEMPTS` times in total, then
    put at the centre.

    Args:
        problem: the search.
        confined: whether draws beyond the bounds are moved onto them first.
    """
    n, d = problem.particles, problem.centre.size
    x = np.empty((n, d))
    todo = np.arange(n)
    for _ in range(ATTEMPTS):
        x[todo] = problem.centre + problem.sigma * problem.rng.standard_normal((todo.size, d))
        if confined:
            x[todo] = np.clip(x[todo], *problem.bounds)
        todo = todo[~problem.feasible(x[todo])]
        if todo.size == 0:
            return x
    x[todo] = problem.centre
    return x
