"""The input of the compiled swarms: one stage of a frame."""

from dataclasses import dataclass

import numpy as np

from markerless_tracker.body.collision import Constraints
from markerless_tracker.fitness.raster.kernels import Objective
from markerless_tracker.geometry import FloatArray
from markerless_tracker.tracking.swarms.particles import Particles, make_particles


@dataclass(frozen=True, eq=False)
class SwarmSearch:
    """A search over d parameters: an `optim.Problem` with the body and the evidence.

    Attributes:
        centre, sigma: (d,) as in `Problem`.
        bounds: (2, d) joint limits.
        count, iterations: the budget is their product.
        rng: the source of all draws.
        constraints: joint limits and collisions.
        objective: the costs.
    """

    centre: FloatArray
    sigma: FloatArray
    bounds: FloatArray
    count: int
    iterations: int
    rng: np.random.Generator
    constraints: Constraints
    objective: Objective

    def particles(self) -> Particles:
        """Arrays for the particles."""
        return make_particles(self.count, self.centre, len(self.objective.views.size))
