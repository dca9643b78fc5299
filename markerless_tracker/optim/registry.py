"""The algorithms that search one stage, by name."""

from collections.abc import Callable

from markerless_tracker.optim.apf import Apf
from markerless_tracker.optim.base import Optimizer
from markerless_tracker.optim.mcpso import Mcpso
from markerless_tracker.optim.pf import Pf
from markerless_tracker.optim.pso import Pso
from markerless_tracker.optim.sppso import Sppso

ALGORITHMS: dict[str, Callable[..., Optimizer]] = {
    "sppso": Sppso,
    "pso": Pso,
    "mcpso": Mcpso,
    "apf": Apf,
    "pf": Pf,
}
"""The names for `SearchPlan.algorithm`; its `options` are keyword arguments of the class.

A program may replace an entry by an `Optimizer` of its own (examples/own_optimizer.py).
HPSO, H-MCPSO and GLPSO are stages of these: see `tracking.stages`.
"""
_SHIPPED = dict(ALGORITHMS)


def is_replaced(name: str) -> bool:
    """Whether an entry of `ALGORITHMS` was replaced, so that the compiled swarm is not equal."""
    return ALGORITHMS[name] is not _SHIPPED.get(name)
