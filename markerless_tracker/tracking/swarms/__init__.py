"""Swarms compiled as a whole: samples, moves, constraints and costs of a stage in one call.

Each has a counterpart in `optim` that minimises any function, with the same draws and results.
"""

from collections.abc import Callable, Mapping

from markerless_tracker.tracking.swarms.mcpso import run_mcpso
from markerless_tracker.tracking.swarms.particles import Particles
from markerless_tracker.tracking.swarms.pso import run_pso
from markerless_tracker.tracking.swarms.search import SwarmSearch
from markerless_tracker.tracking.swarms.sppso import run_sppso

SWARMS: Mapping[str, Callable[..., Particles]] = {
    "sppso": run_sppso,
    "mcpso": run_mcpso,
    "pso": run_pso,
}
"""Compiled algorithms by their names in `optim.ALGORITHMS`."""

__all__ = ["SWARMS", "Particles", "SwarmSearch"]
