"""The first frame: the person's shape from the silhouettes, the start pose known or nearly so.

Fitting pose and shape together drifts while the fitness rises, so the pose is held while the shape
is fitted. A start whose markers are noisy would be pressed into the shape: pose and segment lengths
are first moved to where a nearly generic body fits silhouettes and markers, each as far as it is
trusted.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.body import BodyModel, cone_transforms, markers
from markerless_tracker.fitness.contours import ContourFrame
from markerless_tracker.fitness.shape import CORRELATION_M, fit_shape
from markerless_tracker.geometry import FloatArray
from markerless_tracker.optim import Prior, refine
from markerless_tracker.tracking.config import TrackerConfig

TRUSTED_M = 0.003
"""Start markers at most this far off are taken as they are."""
_TIGHT = 3.0
_ITERATIONS = 8
_STEP = 1e-6
_LENGTH_SPREAD = 0.15
_LENGTH_RANGE = (0.7, 1.4)

ContourMaker = Callable[[BodyModel, FloatArray], ContourFrame]
"""Contour evidence of the first frame for a body near a pose (p,)."""


@dataclass(frozen=True, eq=False)
class StartMarkers:
    """The markers that a start pose was taken from.

    Attributes:
        positions_m: (15, 3) world frame, in the order of `MARKER_NAMES`, NaN where missing.
        noise_m: how far they may be off, per coordinate.
        resized: the body with other segment lengths (m, by name) and the sections of a body.
    """

    positions_m: FloatArray
    noise_m: float
    resized: Callable[[Mapping[str, float], BodyModel], BodyModel]


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
    start: StartMarkers | None,
    contours: ContourMaker,
    config: TrackerConfig,
    limits: FloatArray,
) -> tuple[BodyModel, FloatArray]:
    """The body with the person's sections, and the start pose (p,) they were fitted at.

    Args:
        body: the body with generic sections.
        pose: (p,) start pose.
        start: the markers it was taken from, if any.
        contours: makes the frame's contour evidence.
        config: settings of the refinement.
        limits: (2, p) joint limits.
    """
    if start is not None and start.noise_m > TRUSTED_M:
        nearly = fit_shape(body, [(contours(body, pose), pose)], tightness=_TIGHT)
        lengths, pose = _settled(nearly, pose, start, contours(nearly, pose), config, limits)
        body = start.resized(lengths, body)
    return fit_shape(body, [(contours(body, pose), pose)]), pose


def _settled(
    body: BodyModel,
    pose: FloatArray,
    start: StartMarkers,
    contours: ContourFrame,
    config: TrackerConfig,
    limits: FloatArray,
) -> tuple[dict[str, float], FloatArray]:
    """Lengths and pose (p,) that fit contours and markers; both sides' lengths stay alike."""
    scale = 1.0 / (CORRELATION_M * config.refine_sigma_m**2)
    names = sorted({_side_free(name) for name in body.lengths_m})
    begin = np.array([body.lengths_m.get(n, body.lengths_m.get("l_" + n, 0.0)) for n in names])
    seen = np.isfinite(start.positions_m).all(axis=1)
    p = body.size

    def lengths(z: FloatArray) -> dict[str, float]:
        values = dict(zip(names, z[p:], strict=True))
        return {name: float(values[_side_free(name)]) for name in body.lengths_m}

    def points(z: FloatArray, model: BodyModel) -> tuple[FloatArray, FloatArray]:
        found = [
            _surface(model, z[:p], contours.samples.cone[v, rows], contours.samples.shape[v, rows])
            for v, rows in enumerate(_rows(contours))
        ]
        return np.concatenate(found), markers(model, z[:p])[seen]

    def equations(z: FloatArray, reach_m: float) -> tuple[FloatArray, FloatArray]:
        model = start.resized(lengths(z), body)
        contours.collect(z[:p], reach_m, model)
        surface, joints = points(z, model)
        r = contours.residuals
        counts = [int(n) for n in r.count]
        gradient = np.concatenate([r.gradient[v, :n] for v, n in enumerate(counts)])
        value = np.concatenate([r.value[v, :n] for v, n in enumerate(counts)])
        weight = np.concatenate([r.weight[v, :n] for v, n in enumerate(counts)]) * scale
        rows = np.empty((value.size, z.size))
        marks = np.empty((joints.size, z.size))
        for i in range(z.size):
            moved = z.copy()
            moved[i] += _STEP
            changed = model if i < p else start.resized(lengths(moved), body)
            there, other = points(moved, changed)
            rows[:, i] = np.einsum("ni,ni->n", gradient, there - surface) / _STEP
            marks[:, i] = (other - joints).ravel() / _STEP
        gap = (joints - start.positions_m[seen]).ravel()
        trust = 1.0 / start.noise_m**2
        return (
            rows.T @ (weight[:, None] * rows) + trust * marks.T @ marks,
            rows.T @ (weight * value) + trust * marks.T @ gap,
        )

    z = refine(
        equations,
        np.concatenate([pose, begin]),
        priors=(
            Prior(
                np.concatenate([body.neutral, begin]),
                np.concatenate([1.0 / body.spread**2, 1.0 / (_LENGTH_SPREAD * begin) ** 2]),
            ),
        ),
        bounds=np.concatenate([limits, np.outer(_LENGTH_RANGE, begin)], axis=1),
        iterations=_ITERATIONS,
        reach=(config.refine_reach_m, config.refine_reach_end_m),
    )
    return lengths(z), z[:p]


def _side_free(name: str) -> str:
    return name[2:] if name[:2] in ("l_", "r_") else name


def _rows(contours: ContourFrame) -> list[NDArray[np.int64]]:
    """Per view the samples that its residuals belong to."""
    r = contours.residuals
    return [r.sample[v, : int(n)] for v, n in enumerate(r.count)]


def _surface(
    body: BodyModel, pose: FloatArray, cone: NDArray[np.int64], shape: FloatArray
) -> FloatArray:
    """World points (n, 3) of outline samples (see `Samples.shape`) on a body at a pose (p,)."""
    placed = cone_transforms(body, pose)[cone]
    ends = []
    for end in range(2):
        rx, ry, ox, oy = np.moveaxis(body.cone_shape[cone, end], 1, 0)
        cos, sin = shape[:, 2 * end], shape[:, 2 * end + 1]
        ends.append(np.stack([ox + rx * cos, oy + ry * sin, end * body.cone_length[cone]], axis=1))
    t = shape[:, 4:]
    local = (1.0 - t) * ends[0] + t * ends[1]
    return np.asarray(np.einsum("nij,nj->ni", placed[:, :, :3], local) + placed[:, :, 3])
