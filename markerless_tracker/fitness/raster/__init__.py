"""Projected cones as bits: their outlines, filled and counted against silhouettes and edge maps.

Kernels import each other from their own modules, since the names of stored kernels depend on the
modules that they import.
"""

from markerless_tracker.fitness.raster.edge_samples import OUTLINE, SIDES, VISIBLE, EdgeRule
from markerless_tracker.fitness.raster.kernels import evaluate, make_scratch
from markerless_tracker.fitness.raster.outline_arrays import Outlines, make_outlines

__all__ = [
    "OUTLINE",
    "SIDES",
    "VISIBLE",
    "EdgeRule",
    "Outlines",
    "evaluate",
    "make_outlines",
    "make_scratch",
]
