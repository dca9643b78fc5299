"""Which searches a frame is made of: the algorithms' partitions of the body, as lists of stages."""

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.body import BodyModel
from markerless_tracker.body.model import IntArray
from markerless_tracker.errors import ConfigError
from markerless_tracker.geometry import FloatArray
from markerless_tracker.records import CONTOUR, Stage
from markerless_tracker.tracking.config import TrackerConfig

SPPSO_STAGES = ((10, 20), (20, 40))
"""Particles and iterations of SPPSO's two stages at 1000 evaluations."""
SWARM_SHARE = Fraction(2, 10)
"""Share of the budget that the swarm keeps beside contour refinement."""
RESCUE_STAGES = ((40, 5), (80, 10))
"""The same evaluations beside contour refinement: it homes in, so the swarm may look widely."""
LIMB_SWARM = (10, 5)
"""Particles and iterations of each limb's own swarm at a budget of 1000."""
_TRUNK = ("root", "torso_head")
_SOFT = 10.0
_TRANSLATION = 3


def frame_stages(
    body: BodyModel, config: TrackerConfig, centre: FloatArray, sigma: FloatArray
) -> tuple[Stage, ...]:
    """The stages of one frame, in order; each starts from the estimate so far.

    Beside a refinement, swarms must raise f clearly: a body part that is found again does, while
    without asking for that the parts that no view shows would wander.

    Args:
        body: the body.
        config: names the optimiser and how the budget is shared out.
        centre: (p,) predicted pose.
        sigma: (p,) published spreads, widened for the time since the last frame.

    Raises:
        ConfigError: the budget cannot be spent exactly.
    """
    swarm = STAGES[config.optimizer](body, config, centre, config.sigma_scale * sigma)
    if config.refinement == "none":
        return swarm
    return (
        contour_stage("align", body, config, centre, sigma),
        *(replace(stage, gain=config.swarm_gain) for stage in swarm),
        *limb_stages(body, config, centre, sigma),
        contour_stage("polish", body, config, centre, sigma),
    )


def limb_stages(
    body: BodyModel, config: TrackerConfig, centre: FloatArray, sigma: FloatArray
) -> tuple[Stage, ...]:
    """A small, wide swarm for each limb alone: finds one that the refinement has lost."""
    every_cone = np.ones(len(body.cone_names), dtype=np.bool_)
    particles, iterations = LIMB_SWARM
    return tuple(
        Stage(
            name=name,
            algorithm="sppso",
            active=active,
            centre=centre,
            sigma=config.limb_spread * sigma,
            particles=max(1, particles * config.evaluations // 1000),
            iterations=iterations,
            silhouette_weight=1.0,
            edge_weight=config.edge_weight,
            silhouette_cones=every_cone,
            edge_cones=every_cone,
            gain=config.swarm_gain,
        )
        for name, active in body.subspaces.items()
        if name not in _TRUNK
    )


def contour_stage(
    name: str, body: BodyModel, config: TrackerConfig, centre: FloatArray, sigma: FloatArray
) -> Stage:
    """A contour refinement of all parameters."""
    every_cone = np.ones(len(body.cone_names), dtype=np.bool_)
    return Stage(
        name=name,
        algorithm=CONTOUR,
        active=np.arange(body.size),
        centre=centre,
        sigma=config.refine_prior * sigma,
        particles=0,
        iterations=config.refine_iterations,
        silhouette_weight=1.0,
        edge_weight=config.edge_weight,
        silhouette_cones=every_cone,
        edge_cones=every_cone,
    )


def scaled_particles(
    published: tuple[tuple[int, int], ...],
    evaluations: int,
    optimizer: str,
    *,
    share: Fraction = Fraction(1),
) -> tuple[int, ...]:
    """Particles per stage for the swarm's share of a budget: they scale, the iterations stay.

    Raises:
        ConfigError: the budget cannot be met exactly; names the nearest that can.
    """
    whole = sum(particles * iterations for particles, iterations in published) / share
    step = math.ceil(whole / math.gcd(*(particles for particles, _ in published)))
    if evaluations % step or evaluations <= 0:
        below, above = evaluations // step * step, (evaluations // step + 1) * step
        near = f"{below} or {above}" if below > 0 else f"{above} or {above + step}"
        raise ConfigError(
            f"evaluations is {evaluations}, which {optimizer} cannot spend exactly: "
            f"nearest are {near}"
        )
    return tuple(int(particles * evaluations / whole) for particles, _ in published)


def sppso_stages(
    body: BodyModel, config: TrackerConfig, centre: FloatArray, sigma: FloatArray
) -> tuple[Stage, ...]:
    """SPPSO's soft partition (section 3): the root first, then everything, the root nearly fixed.

    Stage 1 varies the root's six parameters and samples edges on the cones that are rigid with
    it; stage 2 varies all, with the root's position spread divided by 10, from stage 1's estimate.
    Beside a refinement the swarm keeps `SWARM_SHARE` of the budget.
    """
    alone = config.refinement == "none"
    published = SPPSO_STAGES if alone else RESCUE_STAGES
    share = Fraction(1) if alone else SWARM_SHARE
    first, second = scaled_particles(published, config.evaluations, "sppso", share=share)
    steps = {"root": (first, published[0][1]), "body": (second, published[1][1])}
    every_cone = np.ones(len(body.cone_names), dtype=np.bool_)
    settled = sigma.copy()
    settled[translations(body)] /= _SOFT

    def stage(
        name: str, active: IntArray, spread: FloatArray, edge_cones: NDArray[np.bool_]
    ) -> Stage:
        particles, iterations = steps[name]
        return Stage(
            name=name,
            algorithm="sppso",
            active=active,
            centre=centre,
            sigma=spread,
            particles=particles,
            iterations=iterations,
            silhouette_weight=1.0,
            edge_weight=config.edge_weight,
            silhouette_cones=every_cone,
            edge_cones=edge_cones,
        )

    trunk = body.cone_node == body.frames[body.root_frame]
    return (
        stage("root", body.root, sigma, trunk),
        stage("body", np.arange(body.size), settled, every_cone),
    )


def translations(body: BodyModel) -> IntArray:
    """Indices of the parameters that are translations."""
    moving = body.node_kind >= _TRANSLATION
    return np.sort(body.node_parameter[moving])


StageMaker = Callable[[BodyModel, TrackerConfig, FloatArray, FloatArray], tuple[Stage, ...]]

STAGES: Mapping[str, StageMaker] = {"sppso": sppso_stages}
"""The partition of each optimiser that `TrackerConfig.optimizer` may name."""
