"""Which cameras are wrong: the fewest whose correction explains the contours.

Images alone do not say which of two opposite cameras is wrong. A calibration was right once, so
few wrong cameras are more likely than many: cameras are freed one after the other, the one first
that explains most, as in forward selection of regressors.
"""

import numpy as np

from markerless_tracker.calibration.contours.adjust import PRIOR_SD, ContourAdjustment, Evaluation
from markerless_tracker.calibration.contours.cameras import CHANGES
from markerless_tracker.fitness.shape.section_fit import RESIDUAL_SIGMA_M
from markerless_tracker.geometry import FloatArray

LEAST_GAIN = 12.0
"""Least drop of -log p for which a camera's seven changes are believed: half the value that
chi-squared with seven degrees of freedom exceeds once in a thousand times."""
LEAST_HELD = 2
"""Cameras that are right and keep the world in its place."""
_TRIED = 2
_NEARLY = 0.5
_FIRST, _MORE = 7, 9
_NEAR_M = 0.1


def free_wrong_cameras(
    adjustment: ContourAdjustment, displaced_m: float
) -> tuple[ContourAdjustment, list[int]]:
    """The adjustment with the wrong cameras free, and their numbers in the order they were found.

    All cameras are free, and stay where they are on average, if fewer than `LEAST_HELD` agree.

    Args:
        adjustment: with all cameras held.
        displaced_m: a camera is wrong if it displaces the person by this much at least.
    """
    adjustment.run(_FIRST)
    wrong: list[int] = []
    while True:
        now = adjustment.evaluation()
        found = None
        for number in _most_promising(now, wrong, len(adjustment.cameras)):
            trial = adjustment.copy()
            trial.free[number] = True
            trial.run(_MORE)
            after = trial.evaluation()
            gain = (now.cost - after.cost) * scale_of(after)
            far = trial.displacements_m()[number] >= displaced_m
            if gain >= LEAST_GAIN and far and (found is None or gain > found[0]):
                found = gain, number, trial
        if found is None:
            return adjustment, wrong
        _, number, adjustment = found
        wrong.append(number)
        if len(adjustment.cameras) - len(wrong) < LEAST_HELD:
            adjustment.free[:] = True
            adjustment.run(_MORE, _NEAR_M)
            return adjustment, list(range(len(adjustment.cameras)))


def scale_of(evaluation: Evaluation) -> float:
    """Factor of the information by which residuals are smaller than assumed (variance factor)."""
    return (RESIDUAL_SIGMA_M / evaluation.residual_m) ** 2


def _most_promising(now: Evaluation, wrong: list[int], cameras: int) -> list[int]:
    """The held cameras that one step suggests, the best first; their change drops -log p most."""
    freed = [CHANGES * c + i for c in wrong for i in range(CHANGES)]
    prior = np.diag(np.tile(1.0 / PRIOR_SD**2, cameras))
    full = now.information + prior
    gains = {}
    for number in set(range(cameras)) - set(wrong):
        own = [CHANGES * number + i for i in range(CHANGES)]
        matrix: FloatArray = full[np.ix_(own, own)]
        if freed:
            cross = full[np.ix_(own, freed)]
            matrix = matrix - cross @ np.linalg.solve(full[np.ix_(freed, freed)], cross.T)
        pull = now.slope[own]
        gains[number] = 0.5 * float(pull @ np.linalg.solve(matrix, pull)) * scale_of(now)
    order = sorted(gains, key=lambda number: -gains[number])
    least = max(0.5 * LEAST_GAIN, _NEARLY * gains[order[0]])
    return [number for number in order[:_TRIED] if gains[number] >= least]
