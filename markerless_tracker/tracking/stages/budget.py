"""Divides a budget of evaluations: particles scale with it.

If a refinement takes a part of the budget, the swarms have fewer particles (`scaled_particles`) or
fewer iterations (`shared_out`).
"""

import math
from collections.abc import Sequence
from fractions import Fraction

from markerless_tracker.errors import ConfigError
from markerless_tracker.tracking.config import TrackerConfig

SWARM_SHARE = Fraction(2, 10)
"""The swarm's fraction of the budget if there is contour refinement, too."""


def swarm_share(config: TrackerConfig) -> Fraction:
    """The swarm's fraction of the budget."""
    return Fraction(1) if config.refinement == "none" else SWARM_SHARE


def scaled_particles(
    published: Sequence[tuple[int, int]],
    evaluations: int,
    optimizer: str,
    *,
    share: Fraction = Fraction(1),
) -> tuple[int, ...]:
    """Particles per stage for a share of a budget; the iterations are the published ones.

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


def shared_out(
    published: Sequence[tuple[int, int]], config: TrackerConfig
) -> tuple[tuple[int, int], ...]:
    """Particles and iterations per stage; with contour refinement fewer iterations.

    Swarms of few particles need all of them, and few iterations are enough near the optimum.

    Raises:
        ConfigError: the budget cannot be met exactly; names the nearest that can.
    """
    particles = scaled_particles(published, config.evaluations, config.optimizer)
    share = swarm_share(config)
    return tuple(
        (n, max(1, math.floor(iterations * share)))
        for n, (_, iterations) in zip(particles, published, strict=True)
    )
