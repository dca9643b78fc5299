"""Which searches a frame is made of: the algorithms' partitions of the body, as lists of stages."""

from collections.abc import Callable, Mapping
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.body import BodyModel
from markerless_tracker.body.model import IntArray
from markerless_tracker.errors import ConfigError
from markerless_tracker.geometry import FloatArray
from markerless_tracker.records import Stage
from markerless_tracker.tracking.config import TrackerConfig

SPPSO_STAGES = ((10, 20), (20, 40))
"""Particles and iterations of SPPSO's two stages at 1000 evaluations."""
_SOFT = 10.0
_TRANSLATION = 3


def scaled_particles(
    published: tuple[tuple[int, int], ...], evaluations: int, optimizer: str
) -> tuple[int, ...]:
    """Particles per stage for a budget: they scale with it, the iterations stay.

    Raises:
        ConfigError: the budget cannot be met exactly; names the nearest that can.
    """
    whole = sum(particles * iterations for particles, iterations in published)
    smallest = np.gcd.reduce([particles for particles, _ in published])
    step = whole // int(smallest)
    if evaluations % step or evaluations <= 0:
        below, above = evaluations // step * step, (evaluations // step + 1) * step
        near = f"{below} or {above}" if below > 0 else f"{above} or {above + step}"
        raise ConfigError(
            f"evaluations is {evaluations}, which {optimizer} cannot spend exactly: "
            f"nearest are {near}"
        )
    share = Fraction(evaluations, whole)
    return tuple(int(particles * share) for particles, _ in published)


def sppso_stages(
    body: BodyModel, config: TrackerConfig, centre: FloatArray, sigma: FloatArray
) -> tuple[Stage, ...]:
    """SPPSO's soft partition (section 3): the root first, then everything, the root nearly fixed.

    Stage 1 varies the root's six parameters and samples edges on the cones that are rigid with
    it; stage 2 varies all, with the root's position spread divided by 10, from stage 1's estimate.
    """
    first, second = scaled_particles(SPPSO_STAGES, config.evaluations, "sppso")
    every_cone = np.ones(len(body.cone_names), dtype=np.bool_)
    settled = sigma.copy()
    settled[translations(body)] /= _SOFT

    def stage(
        name: str, active: IntArray, spread: FloatArray, edge_cones: NDArray[np.bool_]
    ) -> Stage:
        particles, iterations = {"root": (first, 20), "body": (second, 40)}[name]
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
