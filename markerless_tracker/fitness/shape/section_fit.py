"""Sections, offsets and the length of the hands, fitted to silhouettes at known poses."""

from collections.abc import Generator

import numpy as np

from markerless_tracker.body import BodyModel
from markerless_tracker.fitness.contour import ContourFrame, normal_equations, outline_rows
from markerless_tracker.fitness.shape.pieces import at_once
from markerless_tracker.fitness.shape.sections import Sections
from markerless_tracker.geometry import FloatArray
from markerless_tracker.optim import Prior, refine
from markerless_tracker.optim.gauss_newton import Equations, truncations

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
    hands: bool = True,
    tightness: float = 1.0,
) -> BodyModel:
    """The body with sections, offsets and hands fitted to silhouettes, at known poses.

    Bounded least squares on contour distances with the prior of `Sections`; left and right
    limbs are equal, trunk and head symmetric. Poses are fixed: fitting both together drifts.

    Args:
        body: the body with generic sections and hands (those of the subject's lengths).
        frames: contour evidence of some frames and the pose (p,) in each.
        hands: whether the length of the hands is fitted, too.
        tightness: factor of the prior's precision.
    """
    weighted = [(contours, pose, 1.0) for contours, pose in frames]
    return at_once(
        shape_fitting(
            body, weighted, start=body, hands=hands, tightness=tightness,
            iterations=ITERATIONS, truncation_m=TRUNCATION_M,
        )
    )  # fmt: skip


def shape_fitting(
    body: BodyModel,
    frames: list[tuple[ContourFrame, FloatArray, float]],
    *,
    start: BodyModel,
    iterations: int,
    truncation_m: tuple[float, float],
    hands: bool = True,
    tightness: float = 1.0,
) -> Generator[None, None, BodyModel]:
    """As `fit_shape`, in pieces: yields after each frame of each iteration.

    Args:
        body: the body with generic sections and hands.
        frames: contour evidence of some frames, the pose (p,) in each, and its weight.
        start: the body with the sections and hands to begin with.
        iterations: Gauss-Newton steps.
        truncation_m: residuals beyond it are outliers, in the first and in the last step.
        hands: whether the length of the hands is fitted, too.
        tightness: factor of the prior's precision.

    Returns:
        The body with the fitted sections and hands.
    """
    sections = Sections(body, hands=hands)
    prior = Prior(sections.prior_mean, tightness / sections.prior_sd**2)
    scale = 1.0 / (CORRELATION_M * RESIDUAL_SIGMA_M**2 * sum(weight for _, _, weight in frames))
    shape = sections.of(start)
    for bound_m in truncations(*truncation_m, iterations):
        shaped = sections.put(body, shape)
        hessian, gradient = np.zeros((sections.size, sections.size)), np.zeros(sections.size)
        for frame, pose, weight in frames:
            frame.collect(pose, float(bound_m), shaped)
            rows = outline_rows(frame)
            jacobian = sections.jacobian(shaped, pose, rows)
            one = normal_equations(jacobian, rows.weight, rows.value)
            hessian += weight * scale * one[0]
            gradient += weight * scale * one[1]
            yield
        shape = refine(
            _sums(hessian, gradient), shape, priors=(prior,), bounds=sections.bounds, iterations=1,
            truncation=(float(bound_m), float(bound_m)),
        )  # fmt: skip
    return sections.put(body, shape)


def _sums(hessian: FloatArray, gradient: FloatArray) -> Equations:
    """Constant equations, for a refinement of one iteration."""
    return lambda _, __: (hessian, gradient)


def unfitted(body: BodyModel, generic: BodyModel) -> BodyModel:
    """A body with the sections and hands of the generic body, its other lengths unchanged."""
    sections = Sections(generic, hands=True)
    return sections.put(body, sections.of(generic))
