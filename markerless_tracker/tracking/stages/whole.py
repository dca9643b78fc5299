"""Algorithms that search the whole body at once: PSO and MCPSO.

Saini et al., PLoS ONE 10(5):e0127833, 2015, whose comparison gives both 20 particles x 180
iterations, 3600 evaluations.
"""

import numpy as np

from markerless_tracker.body import BodyModel
from markerless_tracker.geometry import FloatArray
from markerless_tracker.records import Stage
from markerless_tracker.tracking.config import TrackerConfig
from markerless_tracker.tracking.stages.budget import shared_out
from markerless_tracker.tracking.stages.hmcpso import check_swarms
from markerless_tracker.tracking.stages.stage import swarm_stage

WHOLE = ((20, 180),)
"""Particles and iterations at 3600 evaluations."""


def whole_stages(
    body: BodyModel, config: TrackerConfig, centre: FloatArray, sigma: FloatArray
) -> tuple[Stage, ...]:
    """One stage of the configured optimiser, over all parameters.

    Raises:
        ConfigError: the budget cannot be spent exactly, or has too few particles.
    """
    (budget,) = shared_out(WHOLE, config)
    if config.optimizer == "mcpso":
        check_swarms(budget[0], config)
    every = np.arange(body.size)
    return (swarm_stage(body, config, "body", config.optimizer, every, centre, sigma, budget),)
