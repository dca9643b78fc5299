"""Particle filters over the whole body: APF in layers, PF in one.

APF: 600 particles x 6 layers, 3600 evaluations, in Saini et al. (2015); 200 x 5, 1000 evaluations,
in HumanEva's baseline (Sigal, Balan and Black, 2010) and in SPPSO's comparison [R].
"""

import numpy as np

from markerless_tracker.body import BodyModel
from markerless_tracker.geometry import FloatArray
from markerless_tracker.records import Stage
from markerless_tracker.tracking.config import TrackerConfig
from markerless_tracker.tracking.stages.budget import scaled_particles, swarm_share
from markerless_tracker.tracking.stages.stage import swarm_stage


def filter_stages(
    body: BodyModel, config: TrackerConfig, centre: FloatArray, sigma: FloatArray
) -> tuple[Stage, ...]:
    """One stage; with contour refinement it has `SWARM_SHARE` of the particles.

    Raises:
        ConfigError: the budget is no multiple of the layers.
    """
    layers = 1 if config.optimizer == "pf" else layers_for(config)
    (particles,) = scaled_particles(
        ((1, layers),), config.evaluations, config.optimizer, share=swarm_share(config)
    )
    every = np.arange(body.size)
    return (
        swarm_stage(
            body, config, "body", config.optimizer, every, centre, sigma, (particles, layers)
        ),
    )


def layers_for(config: TrackerConfig) -> int:
    """Layers of APF: as configured, else six if the budget is a multiple of six, else five."""
    return config.apf.layers or (6 if config.evaluations % 6 == 0 else 5)
