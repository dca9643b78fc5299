"""Compares the projected body with image evidence: the costs that searches minimise."""

from markerless_tracker.fitness.arrays import Views, lay_out_views
from markerless_tracker.fitness.evaluator import (
    COSTS,
    EDGE_RULES,
    EDGE_TERMS,
    Evaluator,
    Fitness,
    ViewTerms,
)

__all__ = [
    "COSTS",
    "EDGE_RULES",
    "EDGE_TERMS",
    "Evaluator",
    "Fitness",
    "Views",
    "ViewTerms",
    "lay_out_views",
]
