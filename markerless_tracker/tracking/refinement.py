"""Contour refinement of a pose: Gauss-Newton on the outlines, with priors and joint limits."""

from markerless_tracker.body import BodyModel
from markerless_tracker.body.angles.swing import straightness, twists
from markerless_tracker.fitness.contour.frame import ContourFrame
from markerless_tracker.fitness.shape.section_fit import CORRELATION_M
from markerless_tracker.geometry import FloatArray
from markerless_tracker.optim import Prior
from markerless_tracker.tracking.config import TrackerConfig


def data_precision(config: TrackerConfig) -> float:
    """Factor (1 / m³) from sums of squared residuals over outline length to -2 log p."""
    return 1.0 / (CORRELATION_M * config.refine.sigma_m**2)


STRAIGHT_TWIST_SD_RAD = 0.05
"""Standard deviation, in the refinement, of a straight limb's rotation about itself: near the usual
value, whatever the outline's noise and the sections' error suggest."""


HEAD_TURN_SD_RAD = 0.04
"""The same of the head's turn: the outline of a head is that of an egg, nearly round."""
_HEAD_TURN = "head_z"


def pose_prior(body: BodyModel, weight: float = 1.0, at: FloatArray | None = None) -> Prior:
    """The prior of people's poses, its precision times a weight.

    Args:
        body: the body.
        weight: the factor.
        at: (p,) a pose near the one sought: limbs that are straight there, and the head, keep
            the usual rotation about themselves. That is a convention, not knowledge: no deviation
            follows from it.
    """
    precision = weight / body.prior_sd**2
    if at is not None:
        straight = straightness(body, at)
        precision[twists(body)] += weight * straight / STRAIGHT_TWIST_SD_RAD**2
        if straight.size and _HEAD_TURN in body.parameter_names:
            turn = body.index(_HEAD_TURN)
            precision[turn] += weight / HEAD_TURN_SD_RAD**2
    return Prior(body.prior_mean, precision)


def refined_on_contours(
    contours: ContourFrame,
    start: FloatArray,
    config: TrackerConfig,
    *,
    priors: tuple[Prior, ...],
    limits: FloatArray,
    iterations: int,
    truncation_m: tuple[float, float],
) -> FloatArray:
    """Refine a pose (p,) on the contour evidence of a frame; returns the refined one.

    Args:
        contours: the evidence.
        start: (p,) where to begin.
        config: `refine.sigma_m`, the standard deviation of a residual.
        priors: added to the data.
        limits: (2, p), kept.
        iterations: Gauss-Newton steps.
        truncation_m: residuals beyond it are outliers, in the first and in the last step.
    """
    return contours.refined(
        start,
        precision=data_precision(config),
        priors=priors,
        bounds=limits,
        iterations=iterations,
        truncation_m=truncation_m,
    )
