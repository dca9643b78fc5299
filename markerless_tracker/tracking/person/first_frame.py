"""Fits the person's sections to the silhouettes of the first frame, given the start pose.

Pose and shape fitted together drift while the fitness rises, so the pose is held while the sections
are fitted. Noise of the start markers would enter the sections. So pose and segment lengths are
first refined with a nearly generic body on silhouettes and markers, weighted by their precision.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from markerless_tracker.body import BodyModel, markers
from markerless_tracker.body.sizes import Sizes
from markerless_tracker.fitness.contour import ContourFrame, normal_equations, outline_rows, surface
from markerless_tracker.fitness.shape import fit_shape
from markerless_tracker.geometry import FloatArray
from markerless_tracker.optim import Prior, refine
from markerless_tracker.tracking.config import TrackerConfig
from markerless_tracker.tracking.refinement import data_precision

TRUSTED_M = 0.003
"""Start markers with at most this standard deviation are used unchanged."""
_TIGHT = 3.0
_ITERATIONS = 8
_STEP = 1e-6
_LENGTH_SD = 0.15
_LENGTH_RANGE = (0.7, 1.4)

ContourMaker = Callable[[BodyModel, FloatArray], ContourFrame]
"""Contour evidence of the first frame for a body near a pose (p,)."""


@dataclass(frozen=True, eq=False)
class StartMarkers:
    """The markers that a start pose was taken from.

    Attributes:
        positions_m: (15, 3) world frame, in the order of `MARKER_NAMES`, NaN where missing.
        noise_m: their standard deviation per coordinate.
        sizes: makes the body of other lengths.
    """

    positions_m: FloatArray
    noise_m: float
    sizes: Sizes


def start_noise_m(lengths_m: Mapping[str, float]) -> float:
    """Standard deviation of a row's markers per coordinate, estimated from segment lengths, m.

    Left and right segments of a person are equally long, so their differences are noise. Each
    difference is the sum of four markers' errors along the segment, hence has twice the standard
    deviation of one coordinate. 0 without pairs.
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
    start: StartMarkers | None,
    contours: ContourMaker,
    config: TrackerConfig,
    limits: FloatArray,
) -> tuple[BodyModel, FloatArray]:
    """The body with the person's sections, and the pose (p,) at which they were fitted.

    Args:
        body: the body with generic sections.
        pose: (p,) start pose.
        start: the markers that it was computed from, if any.
        contours: makes the frame's contour evidence.
        config: settings of the refinement.
        limits: (2, p) joint limits.
    """
    hands = config.fit_lengths
    if start is not None and start.noise_m > TRUSTED_M:
        nearly = fit_shape(body, [(contours(body, pose), pose)], hands=hands, tightness=_TIGHT)
        lengths, pose = _settled(nearly, pose, start, contours(nearly, pose), config, limits)
        body = start.sizes.body(lengths, body)
    return fit_shape(body, [(contours(body, pose), pose)], hands=hands), pose


def _settled(
    body: BodyModel,
    pose: FloatArray,
    start: StartMarkers,
    contours: ContourFrame,
    config: TrackerConfig,
    limits: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Lengths (k,) and pose (p,) refined on contours and markers."""
    scale = data_precision(config)
    begin = start.sizes.of(body)
    seen = np.isfinite(start.positions_m).all(axis=1)
    p = body.size

    def equations(z: FloatArray, truncation_m: float) -> tuple[FloatArray, FloatArray]:
        model = start.sizes.body(z[p:], body)
        contours.collect(z[:p], truncation_m, model)
        rows = outline_rows(contours)
        points, joints = surface(model, z[:p], rows), markers(model, z[:p])[seen]
        jacobian = np.empty((rows.value.size, z.size))
        marks = np.empty((joints.size, z.size))
        for i in range(z.size):
            moved = z.copy()
            moved[i] += _STEP
            changed = model if i < p else start.sizes.body(moved[p:], body)
            gap = surface(changed, moved[:p], rows) - points
            jacobian[:, i] = np.einsum("ni,ni->n", rows.gradient, gap) / _STEP
            marks[:, i] = (markers(changed, moved[:p])[seen] - joints).ravel() / _STEP
        gap = (joints - start.positions_m[seen]).ravel()
        trust = 1.0 / start.noise_m**2
        hessian, gradient = normal_equations(jacobian, scale * rows.weight, rows.value)
        return hessian + trust * marks.T @ marks, gradient + trust * marks.T @ gap

    z = refine(
        equations,
        np.concatenate([pose, begin]),
        priors=(
            Prior(
                np.concatenate([body.prior_mean, begin]),
                np.concatenate([1.0 / body.prior_sd**2, 1.0 / (_LENGTH_SD * begin) ** 2]),
            ),
        ),
        bounds=np.concatenate([limits, np.outer(_LENGTH_RANGE, begin)], axis=1),
        iterations=_ITERATIONS,
        truncation=(config.refine.truncation_m, config.refine.truncation_end_m),
    )
    return z[p:], z[:p]
