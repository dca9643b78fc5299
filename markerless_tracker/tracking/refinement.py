"""Contour refinement of a pose: Gauss-Newton on the outlines, with priors and joint limits."""

from markerless_tracker.body import BodyModel
from markerless_tracker.fitness.contour.frame import ContourFrame
from markerless_tracker.fitness.shape.section_fit import CORRELATION_M
from markerless_tracker.geometry import FloatArray
from markerless_tracker.optim import Prior
from markerless_tracker.tracking.config import TrackerConfig


def data_precision(config: TrackerConfig) -> float:
    """Factor (1 / m³) from sums of squared residuals over outline length to -2 log p."""
    return 1.0 / (CORRELATION_M * config.refine.sigma_m**2)


def pose_prior(body: BodyModel, weight: float = 1.0) -> Prior:
    """The prior of people's poses, its precision times a weight."""
    return Prior(body.prior_mean, weight / body.prior_sd**2)


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
