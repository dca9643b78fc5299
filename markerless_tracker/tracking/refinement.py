"""Contour refinement of a pose: Gauss-Newton on the outlines, with priors and joint limits."""

import numpy as np

from markerless_tracker.body import BodyModel
from markerless_tracker.body.angles.swing import straightness, swing_joints, twists
from markerless_tracker.fitness.contour import SPACING_M, ContourFrame
from markerless_tracker.fitness.shape.section_fit import CORRELATION_M
from markerless_tracker.geometry import FloatArray
from markerless_tracker.optim import Prior
from markerless_tracker.tracking.config import TrackerConfig


def floor_precision(config: TrackerConfig) -> float:
    """Precision (1 / m²) of the prior that no part of the body lies below z = 0; 0 = no floor."""
    return 1.0 / config.refine.floor_sd_m**2 if config.refine.floor_sd_m > 0.0 else 0.0


STRAIGHT_TWIST_SD_RAD = 0.05
"""Standard deviation, in the refinement, of a straight limb's rotation about its own axis from the
usual value; noise of the outline and error of the sections would determine it otherwise. For an arm
bent by more than `HANGING_RAD` that still counts as straight it is the deviation from the predicted
value: a forearm held in the wrong plane would straighten the elbow."""
HANGING_RAD = float(np.deg2rad(12.0))
"""Least flexion of an elbow that partly shows the arm's rotation; usual in hanging arms."""
HEAD_ROTATION_SD_RAD = 0.04
"""Standard deviation, in the refinement, of the head's rotation about its own axis from the usual
value: its outline is nearly round."""
ELBOW_PRECISION = 9.0
"""Factor of the precision of an elbow's prior. In front of the trunk and behind it the outline
shows little of a forearm, and the error of generic sections along a whole limb would determine
it."""
_HEAD_ROTATION = "head_z"
_ELBOWS = ("l_elbow", "r_elbow")
_HIP = "hip"
_LEAST = 1e-12


def data_precision(config: TrackerConfig) -> float:
    """Factor (1 / m³) from sums of squared residuals over outline length to -2 log p."""
    return 1.0 / (CORRELATION_M * config.refine.sigma_m**2)


def pose_prior(body: BodyModel, weight: float = 1.0, at: FloatArray | None = None) -> Prior:
    """The prior of people's poses, its precision times a weight.

    Args:
        body: the body.
        weight: the factor.
        at: (p,) a pose near the solution. Limbs that are straight in it, and the head, are held
            near the usual rotation about their own axes; nearly straight arms near their rotation
            in it. Elbows count `ELBOW_PRECISION` times. This is a convention, not knowledge: the
            reported deviations do not use it.
    """
    mean, precision = body.prior_mean, weight / body.prior_sd**2
    joints = swing_joints(body)
    if at is not None and joints:
        precision[[body.index(n) for n in _ELBOWS if n in body.parameter_names]] *= ELBOW_PRECISION
        # The product of two Gaussians: about the usual value, and about the value in the pose.
        own, held = twists(body), np.zeros(body.size)
        held[own] = weight * straightness(body, at) / STRAIGHT_TWIST_SD_RAD**2
        if _HEAD_ROTATION in body.parameter_names:
            held[body.index(_HEAD_ROTATION)] = weight / HEAD_ROTATION_SD_RAD**2
        arms = np.array([not joint.endswith(_HIP) for joint in joints])
        there = np.zeros(body.size)
        there[own] = held[own] * arms * (1.0 - straightness(body, at, HANGING_RAD))
        precision += held
        mean = mean + there / np.maximum(precision, there + _LEAST) * (at - mean)
    return Prior(mean, precision)


def refined_on_contours(
    contours: ContourFrame,
    start: FloatArray,
    config: TrackerConfig,
    *,
    priors: tuple[Prior, ...],
    limits: FloatArray,
    iterations: int,
    truncation_m: tuple[float, float],
    standing: bool = True,
    spacing_m: float = SPACING_M,
) -> FloatArray:
    """Refine a pose (p,) on the contour evidence of a frame; returns the refined pose.

    Args:
        contours: the evidence.
        start: (p,) initial pose.
        config: `refine.sigma_m`, the standard deviation of a residual, and `refine.floor_sd_m`.
        priors: added to the data.
        limits: (2, p) of the pose.
        iterations: Gauss-Newton steps.
        truncation_m: residuals beyond it are outliers, in the first and in the last step.
        standing: whether the floor's prior uses the height of the ankles; not before the person's
            sizes are known.
        spacing_m: distance of neighbouring outline points along the outline.
    """
    return contours.refined(
        start,
        precision=data_precision(config),
        priors=priors,
        bounds=limits,
        iterations=iterations,
        truncation_m=truncation_m,
        floor_precision=floor_precision(config),
        standing=standing,
        spacing_m=spacing_m,
    )
