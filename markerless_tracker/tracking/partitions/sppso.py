"""SPPSO: the root first, then everything with the root nearly fixed.

Fleischmann, Austvoll, Kwolek: "Particle Swarm Optimization with Soft Search Space Partitioning for
Video-Based Markerless Pose Tracking", ACIVS 2012, section 3: 10 particles x 20 iterations, then 20
x 40, 1000 evaluations.
"""

from fractions import Fraction

import numpy as np

from markerless_tracker.body import BodyModel
from markerless_tracker.body.model import IntArray
from markerless_tracker.geometry import FloatArray
from markerless_tracker.records import Stage
from markerless_tracker.tracking.config import TrackerConfig
from markerless_tracker.tracking.partitions.budget import SWARM_SHARE, scaled_particles
from markerless_tracker.tracking.partitions.stage import swarm_stage

SPPSO_STAGES = ((10, 20), (20, 40))
"""Particles and iterations of SPPSO's two stages at 1000 evaluations."""
RESCUE_STAGES = ((40, 5), (80, 10))
"""The same evaluations beside contour refinement: it homes in, so the swarm may look widely."""
_TRANSLATION = 3


def sppso_stages(
    body: BodyModel, config: TrackerConfig, centre: FloatArray, sigma: FloatArray
) -> tuple[Stage, ...]:
    """SPPSO's soft partition (section 3): the root first, then everything, the root nearly fixed.

    Stage 1 varies the root's six parameters and samples edges on the cones that are rigid with
    it; stage 2 varies all, with the root's position spread divided by `soft_factor`, from stage
    1's estimate; in the hard partition it varies the joints alone. Beside a refinement the swarm
    keeps `SWARM_SHARE` of the budget.
    """
    alone = config.refinement == "none"
    published = SPPSO_STAGES if alone else RESCUE_STAGES
    share = Fraction(1) if alone else SWARM_SHARE
    first, second = scaled_particles(published, config.evaluations, "sppso", share=share)
    (_, few), (_, many) = published
    settled = sigma.copy()
    settled[translations(body)] /= config.soft_factor
    moving = np.arange(body.size) if config.partition == "soft" else body.joints
    trunk = body.cone_node == body.frames[body.root_frame]
    return (
        swarm_stage(
            body, config, "root", "sppso", body.root, centre, sigma, (first, few), edge_cones=trunk
        ),
        swarm_stage(body, config, "body", "sppso", moving, centre, settled, (second, many)),
    )


def translations(body: BodyModel) -> IntArray:
    """Indices of the parameters that are translations."""
    moving = body.node_kind >= _TRANSLATION
    return np.sort(body.node_parameter[moving])
