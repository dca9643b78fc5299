"""Optimisers: they know bounds, draws, costs and feasibility, and no body or image."""

from markerless_tracker.optim.base import Evaluate, Optimizer
from markerless_tracker.optim.draws import keyed_generator
from markerless_tracker.optim.levenberg import Prior, refine
from markerless_tracker.optim.problem import Feasible, Problem, everything_feasible
from markerless_tracker.optim.sppso import UPDATES, Sppso

__all__ = [
    "UPDATES",
    "Evaluate",
    "Feasible",
    "Optimizer",
    "Prior",
    "Problem",
    "Sppso",
    "everything_feasible",
    "keyed_generator",
    "refine",
]
