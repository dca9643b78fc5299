"""SPPSO: the root first, then everything with the root nearly fixed; and the paper's comparisons.

Fleischmann, Austvoll, Kwolek: "Particle Swarm Optimization with Soft Search Space Partitioning for
Video-Based Markerless Pose Tracking", ACIVS 2012, section 3: 10 particles x 20 iterations, then 20
x 40, 1000 evaluations. The paper compares this soft partition in two steps with a soft partition in
three steps, a global search and a hard partition. It does not state their budgets and steps: ours
spend as many evaluations, and the second of three steps varies torso and head.
"""

from collections.abc import Mapping

import numpy as np

from markerless_tracker.body import BodyModel
from markerless_tracker.body.model import IntArray
from markerless_tracker.errors import BodyModelError
from markerless_tracker.geometry import FloatArray
from markerless_tracker.records import Stage
from markerless_tracker.tracking.config import TrackerConfig
from markerless_tracker.tracking.stages.budget import scaled_particles, swarm_share
from markerless_tracker.tracking.stages.stage import swarm_stage

SPPSO_STAGES: Mapping[str, tuple[tuple[int, int], ...]] = {
    "two": ((10, 20), (20, 40)),
    "three": ((10, 20), (10, 20), (20, 30)),
    "global": ((20, 50),),
}
"""Particles and iterations of each stage at 1000 evaluations, by `sppso.stages`."""
RESCUE_STAGES: Mapping[str, tuple[tuple[int, int], ...]] = {
    "two": ((40, 5), (80, 10)),
    "three": ((40, 5), (40, 5), (60, 10)),
    "global": ((100, 10),),
}
"""The same with contour refinement, which converges, so the swarm may be wide: more particles and
fewer iterations."""


def sppso_stages(
    body: BodyModel, config: TrackerConfig, centre: FloatArray, sigma: FloatArray
) -> tuple[Stage, ...]:
    """SPPSO's soft partition (section 3): the root first, then everything, the root nearly fixed.

    Stage 1 varies the root's six parameters and samples edges on the cones that are rigid with it.
    The last stage varies all parameters from the estimate before it; sigma of the root's position,
    and of a middle stage's parameters, is divided by `sigma.soft_factor`. In the hard partition
    every stage varies its own parameters only. With contour refinement the swarm has `SWARM_SHARE`
    of the budget.

    Raises:
        ConfigError: the budget cannot be spent exactly.
        BodyModelError: three stages, and the body has no subspace 'torso_head'.
    """
    alone = config.refinement == "none"
    published = (SPPSO_STAGES if alone else RESCUE_STAGES)[config.sppso.stages]
    particles = scaled_particles(published, config.evaluations, "sppso", share=swarm_share(config))
    trunk = body.cone_node == body.frames[body.root_frame]
    stages: list[Stage] = []
    earlier = np.empty(0, dtype=np.int64)
    widths = sigma.copy()
    for (name, own), count, (_, iterations) in zip(
        _parts(body, config.sppso.stages).items(), particles, published, strict=True
    ):
        active = own if config.partition == "hard" else np.union1d(earlier, own)
        budget = (count, iterations)
        stages.append(
            swarm_stage(
                body, config, name, "sppso", active, centre, widths.copy(), budget,
                edge_cones=trunk if name == "root" else None,
            )
        )  # fmt: skip
        settled = body.translations if name == "root" else own
        widths[settled] /= config.sigma.soft_factor
        earlier = active
    return tuple(stages)


def _parts(body: BodyModel, stages: str) -> dict[str, IntArray]:
    """By stage, the parameters that it adds to those of the stages before."""
    if stages == "global":
        return {"body": np.arange(body.size)}
    if stages == "two":
        return {"root": body.root, "body": body.joints}
    if "torso_head" not in body.subspaces:
        raise BodyModelError(
            f"sppso.stages is 'three': body {body.name} has no subspace 'torso_head'"
        )
    trunk = body.subspaces["torso_head"]
    return {"root": body.root, "trunk": trunk, "body": np.setdiff1d(body.joints, trunk)}
