"""Particle filter (condensation, sampling importance resampling).

Isard and Blake: "Condensation: conditional density propagation for visual tracking", IJCV 1998:
resample the last frame's particles by weight, diffuse by N(0, Σ), weigh, normalise; the estimate is
the weighted mean. That is one layer of the annealed particle filter, with a fixed likelihood
p ∝ exp(-sharpness · cost): costs of poses one sigma apart differ by a few hundredths only, so the
plain exp(-cost) would hardly prefer any. The sharpness is ours: no source gives one for this cost.
"""

from markerless_tracker.geometry import FloatArray
from markerless_tracker.optim.apf import Apf
from markerless_tracker.optim.problem import Problem


class Pf(Apf):
    """All particles in one batch; the problem's iterations should be 1.

    Args:
        problem: the search.
        sharpness: of the likelihood.
        estimate: as for `Apf`.
    """

    def __init__(
        self, problem: Problem, *, sharpness: float = 200.0, estimate: str = "mean"
    ) -> None:
        super().__init__(problem, shrink=1.0, estimate=estimate)
        self._fixed = sharpness

    def _sharpness(self, costs: FloatArray) -> float:
        return self._fixed
