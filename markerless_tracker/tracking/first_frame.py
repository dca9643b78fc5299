"""The first frame: the person's shape from the silhouettes, the start pose known or nearly so.

Fitting pose and shape together drifts while the fitness rises, so the pose is held while the shape
is fitted. A start whose markers are noisy would then be pressed into the shape; it is first moved
to where a nearly generic body fits the silhouettes, as far as the noise lets it.
"""

from collections.abc import Callable, Mapping

import numpy as np

from markerless_tracker.body import BodyModel, markers
from markerless_tracker.fitness.contours import ContourFrame
from markerless_tracker.fitness.shape import fit_shape
from markerless_tracker.geometry import FloatArray
from markerless_tracker.optim import Prior, refine
from markerless_tracker.tracking.config import TrackerConfig

TRUSTED_M = 0.003
"""Start poses at most this far off are held as they are."""
CORRELATION_M = 0.05
_TIGHT = 3.0
_ITERATIONS = 8
_STEP = 1e-6

ContourMaker = Callable[[BodyModel, FloatArray], ContourFrame]
"""Contour evidence of the first frame for a body near a pose (p,)."""


def start_noise_m(lengths_m: Mapping[str, float]) -> float:
    """How far the markers of a row are off, per coordinate, judged by its segment lengths, m.

    Left and right segments of a person are alike, so their differences are noise: each holds four
    markers' errors along the segment, hence twice the spread of one coordinate. 0 without pairs.
    """
    pairs = [
        (value, lengths_m["r_" + name[2:]])
        for name, value in lengths_m.items()
        if name.startswith("l_") and "r_" + name[2:] in lengths_m
    ]
    if not pairs:
        return 0.0
    return float(np.sqrt(np.mean([(left - right) ** 2 for left, right in pairs])) / 2.0)


def shape_of_first_frame(
    body: BodyModel,
    pose: FloatArray,
    noise_m: float,
    contours: ContourMaker,
    config: TrackerConfig,
    limits: FloatArray,
) -> tuple[BodyModel, FloatArray]:
    """The body with the person's sections, and the start pose (p,) they were fitted at.

    Args:
        body: the body with generic sections.
        pose: (p,) start pose.
        noise_m: how far its markers may be off, per coordinate.
        contours: makes the frame's contour evidence.
        config: settings of the refinement.
        limits: (2, p) joint limits.
    """
    if noise_m > TRUSTED_M:
        nearly = fit_shape(body, [(contours(body, pose), pose)], tightness=_TIGHT)
        pose = _settled(nearly, pose, noise_m, contours(nearly, pose), config, limits)
    return fit_shape(body, [(contours(body, pose), pose)]), pose


def _settled(
    body: BodyModel,
    start: FloatArray,
    noise_m: float,
    contours: ContourFrame,
    config: TrackerConfig,
    limits: FloatArray,
) -> FloatArray:
    """The pose (p,) that fits contours and the start's markers, each as far as it is trusted."""
    scale = 1.0 / (CORRELATION_M * config.refine_sigma_m**2)
    target = markers(body, start)

    def equations(pose: FloatArray, reach_m: float) -> tuple[FloatArray, FloatArray]:
        sums = contours.equations(pose, reach_m)
        here = markers(body, pose)
        jacobian = np.empty((here.size, body.size))
        for i in range(body.size):
            moved = pose.copy()
            moved[i] += _STEP
            jacobian[:, i] = ((markers(body, moved) - here) / _STEP).ravel()
        gap = (here - target).ravel()
        return (
            sums.hessian * scale + jacobian.T @ jacobian / noise_m**2,
            sums.slope * scale + jacobian.T @ gap / noise_m**2,
        )

    return refine(
        equations,
        start,
        priors=(Prior(body.neutral, 1.0 / body.spread**2),),
        bounds=limits,
        iterations=_ITERATIONS,
        reach=(config.refine_reach_m, config.refine_reach_end_m),
    )
