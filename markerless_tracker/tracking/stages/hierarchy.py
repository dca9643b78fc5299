"""Hierarchical search: one stage for each step of a hierarchy in the body's description."""

import numpy as np

from markerless_tracker.body import BodyModel
from markerless_tracker.geometry import FloatArray
from markerless_tracker.records import Stage
from markerless_tracker.tracking.config import TrackerConfig
from markerless_tracker.tracking.stages.budget import shared_out
from markerless_tracker.tracking.stages.stage import swarm_stage


def hierarchical_stages(
    body: BodyModel,
    config: TrackerConfig,
    centre: FloatArray,
    sigma: FloatArray,
    *,
    algorithm: str,
    budget: tuple[int, int],
    soft: bool,
) -> tuple[Stage, ...]:
    """A stage per step of the hierarchy `hmcpso.hierarchy`, all with the same budget.

    Args:
        body, config, centre, sigma: as for `frame_stages`.
        algorithm: the optimiser of each step.
        budget: published particles and iterations per step.
        soft: whether the further subspaces of a step vary, too, with their sigmas divided by
            `sigma.soft_factor`.

    Raises:
        ConfigError: the budget cannot be spent exactly.
        BodyModelError: the body has no such hierarchy.
    """
    steps = body.steps(config.hmcpso.hierarchy)
    stages = []
    for step, shares in zip(steps, shared_out((budget,) * len(steps), config), strict=True):
        own = body.subspaces[step[0]]
        joining = [body.subspaces[name] for name in step[1:]] if soft else []
        widths = sigma.copy()
        for members in joining:
            widths[members] /= config.sigma.soft_factor
        widths[own] = sigma[own]
        active = np.unique(np.concatenate([own, *joining]))
        stages.append(
            swarm_stage(body, config, f"step {step[0]}", algorithm, active, centre, widths, shares)
        )
    return tuple(stages)
