"""The stages of a frame: those of each optimiser, and the refinements around them.

`frame` composes them; `budget` divides the evaluations; `effort` decides what a frame needs.
"""

from collections.abc import Callable, Mapping

from markerless_tracker.body import BodyModel
from markerless_tracker.geometry import FloatArray
from markerless_tracker.records import Stage
from markerless_tracker.tracking.config import TrackerConfig
from markerless_tracker.tracking.stages.filters import filter_stages
from markerless_tracker.tracking.stages.glpso import glpso_stages
from markerless_tracker.tracking.stages.hmcpso import hmcpso_stages
from markerless_tracker.tracking.stages.hpso import hpso_stages
from markerless_tracker.tracking.stages.sppso import sppso_stages
from markerless_tracker.tracking.stages.whole import whole_stages

StageMaker = Callable[[BodyModel, TrackerConfig, FloatArray, FloatArray], tuple[Stage, ...]]

STAGES: Mapping[str, StageMaker] = {
    "sppso": sppso_stages,
    "hmcpso": hmcpso_stages,
    "hpso": hpso_stages,
    "mcpso": whole_stages,
    "pso": whole_stages,
    "glpso": glpso_stages,
    "apf": filter_stages,
    "pf": filter_stages,
}
"""The partition of each optimiser that `TrackerConfig.optimizer` may name."""
