"""HPSO: one swarm per step of a hierarchy, each step's result frozen for the next.

John, Trucco and Ivekovic: "Markerless human articulated tracking using hierarchical particle swarm
optimisation", Image and Vision Computing 28, 2010: 10 particles x 60 iterations in each of twelve
steps; in six steps, 3600 evaluations, in the comparison of Saini et al. (2015). Reading [R]: the
twelve subspaces as recalled; with twelve steps a budget scales from 7200 evaluations.
"""

from markerless_tracker.body import BodyModel
from markerless_tracker.geometry import FloatArray
from markerless_tracker.records import Stage
from markerless_tracker.tracking.config import TrackerConfig
from markerless_tracker.tracking.stages.hierarchy import hierarchical_stages

STEP = (10, 60)
"""Particles and iterations of each step."""


def hpso_stages(
    body: BodyModel, config: TrackerConfig, centre: FloatArray, sigma: FloatArray
) -> tuple[Stage, ...]:
    """HPSO's hard partition: every step varies its own parameters only.

    Raises:
        ConfigError: the budget cannot be spent exactly.
        BodyModelError: the body has no such hierarchy.
    """
    return hierarchical_stages(
        body, config, centre, sigma, algorithm="pso", budget=STEP, soft=False
    )
