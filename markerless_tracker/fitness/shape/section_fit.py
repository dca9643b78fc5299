"""Sections and offsets of the cones, fitted to silhouettes at known poses."""

import numpy as np

from markerless_tracker.body import BodyModel
from markerless_tracker.fitness.contour import ContourFrame, normal_equations, outline_rows
from markerless_tracker.fitness.shape.sections import Sections
from markerless_tracker.geometry import FloatArray
from markerless_tracker.optim import Prior, refine

ITERATIONS = 12
TRUNCATION_M = (0.10, 0.04)
"""Residuals beyond this distance are outliers, in the first and in the last iteration."""
RESIDUAL_SIGMA_M = 0.010
"""Assumed standard deviation of an outline's position, for pieces `CORRELATION_M` long."""
CORRELATION_M = 0.05
"""Length of outline with one independent residual."""


def fit_shape(
    body: BodyModel,
    frames: list[tuple[ContourFrame, FloatArray]],
    *,
    tightness: float = 1.0,
) -> BodyModel:
    """The body with sections and offsets fitted to silhouettes, at known poses.

    Bounded least squares on contour distances with a prior on the generic shape; left and right
    limbs are equal, trunk and head symmetric. Poses are fixed: fitting both together drifts.

    Args:
        body: the body with generic sections (those of the subject's lengths).
        frames: contour evidence of some frames and the pose (p,) in each.
        tightness: factor of the prior's precision.
    """
    sections = Sections(body)
    scale = 1.0 / (CORRELATION_M * RESIDUAL_SIGMA_M**2 * len(frames))

    def equations(shape: FloatArray, truncation_m: float) -> tuple[FloatArray, FloatArray]:
        hessian, slope = np.zeros((sections.size, sections.size)), np.zeros(sections.size)
        shaped = sections.put(body, shape)
        for frame, pose in frames:
            frame.collect(pose, truncation_m, shaped)
            rows = outline_rows(frame)
            slopes = sections.slopes(shaped, pose, rows)
            one = normal_equations(slopes, rows.weight, rows.value)
            hessian += one[0]
            slope += one[1]
        return hessian * scale, slope * scale

    prior = Prior(sections.generic, tightness / sections.prior_sd**2)
    fitted = refine(
        equations,
        sections.generic,
        priors=(prior,),
        bounds=sections.bounds,
        iterations=ITERATIONS,
        truncation=TRUNCATION_M,
    )
    return sections.put(body, fitted)
