"""Which cameras are wrong: the fewest whose correction explains the contours.

Images alone do not determine which of two opposite cameras is wrong. A calibration was right once,
so few wrong cameras are more likely than many. All cameras are free first; then the camera that
needs the least correction is held, one after the other, as in backward elimination of regressors.
"""

import numpy as np

from markerless_tracker.calibration.contours.adjust import ContourAdjustment, Evaluation
from markerless_tracker.fitness.shape.section_fit import RESIDUAL_SIGMA_M

LEAST_GAIN = 12.0
"""Least drop of -log p for which a camera's seven changes are accepted: half the 0.999 quantile of
chi-squared with seven degrees of freedom."""
LEAST_HELD = 2
"""Cameras that are right and keep the world in its place."""
_TRIED = 2
_FIRST, _MORE = 9, 7
_NEAR_M = 0.1


def free_wrong_cameras(
    adjustment: ContourAdjustment, displaced_m: float
) -> tuple[ContourAdjustment, list[int]]:
    """The adjustment with the wrong cameras free, and their numbers.

    All cameras are free, and stay where they are on average, if fewer than `LEAST_HELD` agree.

    Args:
        adjustment: to begin with.
        displaced_m: a camera is wrong if it displaces the person by this much at least.
    """
    every = adjustment
    every.free[:] = True
    every.run(_FIRST)
    best = every
    wrong = list(range(len(every.cameras)))
    while wrong:
        now, displaced = best.evaluation(), best.displacements_m()
        order = sorted(wrong, key=lambda number: float(displaced[number]))
        trials = {number: _held(best, number) for number in order[:_TRIED]}
        costs = {number: trial.evaluation().cost for number, trial in trials.items()}
        number = min(costs, key=lambda one: costs[one])
        loss = (costs[number] - now.cost) * scale_of(now)
        if displaced[number] >= displaced_m and loss >= LEAST_GAIN:
            break
        best = trials[number]
        wrong.remove(number)
    if len(every.cameras) - len(wrong) < LEAST_HELD:
        return every, list(range(len(every.cameras)))
    return best, wrong


def scale_of(evaluation: Evaluation) -> float:
    """Factor of the information by which residuals are smaller than assumed (variance factor)."""
    return (RESIDUAL_SIGMA_M / evaluation.residual_m) ** 2


def _held(adjustment: ContourAdjustment, number: int) -> ContourAdjustment:
    """The adjustment with one more camera held."""
    trial = adjustment.copy()
    held = np.logical_not(trial.free)
    held[number] = True
    trial.hold(held)
    trial.run(_MORE, _NEAR_M)
    return trial
