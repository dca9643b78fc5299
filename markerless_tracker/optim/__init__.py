"""Optimisers of functions under bounds and constraints; they know neither body nor image."""

from markerless_tracker.optim.apf import ESTIMATES, Apf
from markerless_tracker.optim.base import Evaluate, Optimizer
from markerless_tracker.optim.draws import keyed_generator
from markerless_tracker.optim.gauss_newton import Prior, refine
from markerless_tracker.optim.mcpso import MASTER_TERMS, Mcpso, swarm_sizes
from markerless_tracker.optim.pf import Pf
from markerless_tracker.optim.problem import Feasible, ParticleSet, Problem, everything_feasible
from markerless_tracker.optim.pso import Pso
from markerless_tracker.optim.registry import ALGORITHMS, is_replaced
from markerless_tracker.optim.sppso import UPDATES, Sppso

__all__ = [
    "ALGORITHMS",
    "ESTIMATES",
    "MASTER_TERMS",
    "UPDATES",
    "Apf",
    "ParticleSet",
    "Evaluate",
    "Feasible",
    "Mcpso",
    "Optimizer",
    "Pf",
    "Prior",
    "Problem",
    "Pso",
    "Sppso",
    "everything_feasible",
    "is_replaced",
    "keyed_generator",
    "refine",
    "swarm_sizes",
]
