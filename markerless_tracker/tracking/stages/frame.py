"""The stages of a frame: those of an optimiser, and contour refinement before and after them."""

import numpy as np

from markerless_tracker.body import BodyModel
from markerless_tracker.geometry import FloatArray
from markerless_tracker.records import CONTOUR, Comparison, SearchPlan, Stage
from markerless_tracker.tracking.config import TrackerConfig
from markerless_tracker.tracking.stages import STAGES
from markerless_tracker.tracking.stages.stage import swarm_stage

LIMB_SWARM = (6, 4)
"""Particles and iterations of each limb's own swarm at a budget of 1000."""


def frame_stages(
    body: BodyModel, config: TrackerConfig, centre: FloatArray, sigma: FloatArray
) -> tuple[Stage, ...]:
    """The stages of one frame, in order; each starts from the estimate of the one before it.

    With contour refinement, swarms must raise f by at least `min_improvement`. Recovering a lost
    body part does. Without that threshold, parts that no view shows would drift.

    Args:
        body: the body.
        config: names the optimiser and the budget.
        centre: (p,) predicted pose.
        sigma: (p,) published standard deviations, widened for the time since the last frame.

    Raises:
        ConfigError: the budget cannot be spent exactly.
    """
    if config.refinement == "none":
        widened = swarm_sigma(body, config, sigma)
        return STAGES[config.optimizer](body, config, centre, widened)
    return (
        contour_stage("align", body, config, centre, sigma),
        *rescue_stages(body, config, centre, sigma),
        contour_stage("polish", body, config, centre, sigma),
    )


def swarm_stages(
    body: BodyModel, config: TrackerConfig, centre: FloatArray, sigma: FloatArray
) -> tuple[Stage, ...]:
    """The stages of `frame_stages` but for the contour refinement; same arguments.

    They are compiled first, since the segmenting process compiles the refinement meanwhile.
    """
    stages = frame_stages(body, config, centre, sigma)
    return tuple(stage for stage in stages if stage.plan.algorithm != CONTOUR)


def rescue_stages(
    body: BodyModel, config: TrackerConfig, centre: FloatArray, sigma: FloatArray
) -> tuple[Stage, ...]:
    """The swarms between the two refinements of a frame; arguments as for `frame_stages`."""
    swarm = STAGES[config.optimizer](body, config, centre, swarm_sigma(body, config, sigma))
    return (
        *(stage.planned(min_improvement=config.min_improvement) for stage in swarm),
        *limb_stages(body, config, centre, sigma),
    )


def limb_stages(
    body: BodyModel, config: TrackerConfig, centre: FloatArray, sigma: FloatArray
) -> tuple[Stage, ...]:
    """A small, wide swarm for each limb, which recovers a limb that the refinement has lost."""
    particles, iterations = LIMB_SWARM
    budget = (max(1, particles * config.evaluations // 1000), iterations)
    stages = (
        swarm_stage(
            body,
            config,
            name,
            "sppso",
            body.subspaces[name],
            centre,
            config.refine.limb_sigma * sigma,
            budget,
        )
        for name in body.limbs
    )
    return tuple(stage.planned(min_improvement=config.min_improvement) for stage in stages)


def swarm_sigma(body: BodyModel, config: TrackerConfig, sigma: FloatArray) -> FloatArray:
    """Sigma (p,) of swarms: the body's sigma, scaled; of angles at least `sigma.angle`.

    Saini et al. (2015) print one covariance of 0.01 for all joints and state no rate. Reading: its
    root, 0.1 rad, exceeds the motion of any joint between frames at 60 frames/s, so it is used at
    every rate, unless a joint's own sigma, which grows with the time, exceeds it.
    """
    scaled = config.sigma.scale * sigma
    angles = np.setdiff1d(np.arange(body.size), body.translations)
    scaled[angles] = np.maximum(scaled[angles], config.sigma.angle)
    return scaled


def contour_stage(
    name: str, body: BodyModel, config: TrackerConfig, centre: FloatArray, sigma: FloatArray
) -> Stage:
    """A contour refinement of all parameters."""
    return Stage(
        name,
        Comparison.whole(centre, len(body.cone_names), edge_weight=config.edge_weight),
        SearchPlan(CONTOUR, config.refine.prior * sigma, 0, config.refine.iterations),
    )
