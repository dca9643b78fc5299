"""GLPSO: the whole body, then legs and arms separately with fewer particles.

Krzeszowski, Kwolek and Wojciechowski: "GPU-accelerated tracking of the motion of 3D articulated
figure", ICCVG 2010, as both papers cite it: global-local particle swarm optimisation. Ours: the
swarm is PSO with inertia; 20 particles x 120 iterations for the body and 10 x 60 for legs and arms
each make the 3600 evaluations of the other algorithms.
"""

import numpy as np

from markerless_tracker.body import BodyModel
from markerless_tracker.geometry import FloatArray
from markerless_tracker.records import Stage
from markerless_tracker.tracking.config import TrackerConfig
from markerless_tracker.tracking.stages.budget import shared_out
from markerless_tracker.tracking.stages.stage import swarm_stage

BODY = (20, 120)
LOCAL = (10, 60)
"""Particles and iterations of the stage of the body, and of each local stage."""


def glpso_stages(
    body: BodyModel, config: TrackerConfig, centre: FloatArray, sigma: FloatArray
) -> tuple[Stage, ...]:
    """A stage of the whole body, then one for each step of the body's hierarchy 'limbs'.

    Raises:
        ConfigError: the budget cannot be spent exactly.
        BodyModelError: the body has no such hierarchy.
    """
    local = {step[0]: body.subspaces[step[0]] for step in body.steps("limbs")}
    parts = {"body": np.arange(body.size), **local}
    shares = shared_out((BODY, *[LOCAL] * len(local)), config)
    return tuple(
        swarm_stage(body, config, name, "pso", active, centre, sigma, share)
        for (name, active), share in zip(parts.items(), shares, strict=True)
    )
