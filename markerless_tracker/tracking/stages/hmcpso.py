"""H-MCPSO: sub-swarms and a master in each of six hierarchical steps.

Saini et al.: "Markerless Human Motion Tracking Using Hierarchical Multi-Swarm Cooperative Particle
Swarm Optimization", PLoS ONE 10(5):e0127833, 2015: root; torso and head; each of four limbs; 3
sub-swarms x 5 and a master of 5 particles, 30 iterations, 3600 evaluations. The swarms, Eqs 1-7 and
Algorithm 1, are `optim.mcpso`.

Readings [R]: the soft variation is not quantified; the root joins the torso's and the legs' steps,
the torso joins the arms' steps, with sigmas divided by 10 (SPPSO's factor); other limbs stay. The
body's description says which subspaces join. "Covariance 0.01" is a variance in rad², the least at
every rate (`frame.swarm_sigma`); positions have the body's own sigmas.
"""

from markerless_tracker.body import BodyModel
from markerless_tracker.errors import ConfigError, SearchError
from markerless_tracker.geometry import FloatArray
from markerless_tracker.optim import swarm_sizes
from markerless_tracker.records import Stage
from markerless_tracker.tracking.config import TrackerConfig
from markerless_tracker.tracking.stages.hierarchy import hierarchical_stages

STEP = (20, 30)
"""Particles, the master's included, and iterations of each step."""


def hmcpso_stages(
    body: BodyModel, config: TrackerConfig, centre: FloatArray, sigma: FloatArray
) -> tuple[Stage, ...]:
    """A stage per step, each with its sub-swarms; softly partitioned if `partition` is soft.

    Raises:
        ConfigError: the budget cannot be spent exactly, or has too few particles.
        BodyModelError: the body has no such hierarchy.
    """
    stages = hierarchical_stages(
        body, config, centre, sigma, algorithm="mcpso", budget=STEP, soft=config.partition == "soft"
    )
    check_swarms(stages[0].plan.particles, config)
    return stages


def check_swarms(particles: int, config: TrackerConfig) -> None:
    """Raise a ConfigError if the particles are too few for the sub-swarms and the master."""
    try:
        swarm_sizes(particles, config.hmcpso.sub_swarms)
    except SearchError as error:
        raise ConfigError(f"evaluations is {config.evaluations}: {error}") from error
