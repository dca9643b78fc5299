"""The body's shape from silhouettes, its pose known: sections and offsets of the cones."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.body import BodyModel, cone_transforms
from markerless_tracker.fitness.contours import ContourFrame
from markerless_tracker.geometry import FloatArray
from markerless_tracker.optim import Prior, refine

ITERATIONS = 12
REACH_M = (0.10, 0.04)
"""Outline further than this from the silhouette's edge is an outlier, at first and at last."""
RADIUS_SPREAD = 0.20
"""How far a person's radii deviate from the generic ones, as a share of them (prior)."""
OFFSET_SPREAD_M = 0.015
RADIUS_RANGE = (0.6, 1.6)
"""Radii stay within this multiple of the generic ones (bounds)."""
OFFSET_RANGE_M = 0.06
RESIDUAL_SIGMA_M = 0.010
"""Noise believed of an outline's position, for pieces of outline `CORRELATION_M` long."""
CORRELATION_M = 0.05


@dataclass(frozen=True, eq=False)
class _Ties:
    """Cones that share their sections: left and right, offsets in y mirrored.

    Attributes:
        index: (c, 2, 4) which shape parameter an entry of `cone_shape` follows, -1 for none.
        sign: (c, 2, 4) with which sign.
        size: number of shape parameters.
    """

    index: NDArray[np.int64]
    sign: FloatArray
    size: int


def fit_shape(
    body: BodyModel,
    frames: list[tuple[ContourFrame, FloatArray]],
    *,
    tightness: float = 1.0,
) -> BodyModel:
    """The body with sections and offsets fitted to silhouettes, at known poses.

    Bounded least squares on contour distances with a prior on the generic shape; left and right
    are alike, the trunk and head symmetric. Poses are held: fitting both together drifts.

    Args:
        body: the body with generic sections (those of the subject's lengths).
        frames: contour evidence of some frames and the pose (p,) in each.
        tightness: factor on the prior's precision; higher trusts the generic shape more.
    """
    ties = _tie(body)
    generic = _gather(body.cone_shape, ties)
    radius = np.zeros(ties.size, dtype=np.bool_)
    radius[ties.index[:, :, :2].ravel()] = True
    spread = np.where(radius, RADIUS_SPREAD * generic, OFFSET_SPREAD_M)
    bounds = np.where(
        radius,
        np.outer(RADIUS_RANGE, generic),
        generic + np.array([[-OFFSET_RANGE_M], [OFFSET_RANGE_M]]),
    )
    scale = 1.0 / (CORRELATION_M * RESIDUAL_SIGMA_M**2)

    def equations(shape: FloatArray, reach_m: float) -> tuple[FloatArray, FloatArray]:
        hessian, slope = np.zeros((ties.size, ties.size)), np.zeros(ties.size)
        shaped = _with_shape(body, shape, ties)
        for frame, pose in frames:
            frame.collect(pose, reach_m, shaped)
            for view in range(len(frame.views.names)):
                rows, value, weight = _rows(frame, view, shaped, pose, ties)
                hessian += rows.T @ (weight[:, None] * rows)
                slope += rows.T @ (weight * value)
        return hessian * (scale / len(frames)), slope * (scale / len(frames))

    prior = Prior(generic, tightness / spread**2)
    fitted = refine(
        equations, generic, priors=(prior,), bounds=bounds, iterations=ITERATIONS, reach=REACH_M
    )
    return _with_shape(body, fitted, ties)


def _rows(
    frame: ContourFrame, view: int, body: BodyModel, pose: FloatArray, ties: _Ties
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Derivatives (n, k) of one view's residuals by the shape parameters, residuals, weights."""
    residuals, samples = frame.residuals, frame.samples
    n = int(residuals.count[view])
    sample = residuals.sample[view, :n]
    cone = samples.cone[view, sample]
    place = samples.shape[view, sample]
    axes = cone_transforms(body, pose)[:, :, :2]
    along = np.einsum("ni,nij->nj", residuals.gradient[view, :n], axes[cone])
    rows = np.zeros((n, ties.size))
    every = np.arange(n)
    for end, share in ((0, 1.0 - place[:, 4]), (1, place[:, 4])):
        cos, sin = place[:, 2 * end], place[:, 2 * end + 1]
        slopes = (cos * along[:, 0], sin * along[:, 1], along[:, 0], along[:, 1])
        for entry, slope in enumerate(slopes):
            index = ties.index[cone, end, entry]
            value = share * slope * ties.sign[cone, end, entry]
            np.add.at(rows, (every[index >= 0], index[index >= 0]), value[index >= 0])
    return rows, residuals.value[view, :n], residuals.weight[view, :n]


def _tie(body: BodyModel) -> _Ties:
    index = np.full((len(body.cone_names), 2, 4), -1, dtype=np.int64)
    sign = np.ones(index.shape)
    known: dict[tuple[str, int, int], int] = {}
    for c, name in enumerate(body.cone_names):
        paired = name[:2] in ("l_", "r_")
        for end in range(2):
            for entry in range(4):
                if entry == 3:
                    # Offsets to the side: none on the middle line, mirrored on the limbs.
                    if not paired:
                        continue
                    sign[c, end, entry] = 1.0 if name[0] == "l" else -1.0
                key = (name[2:] if paired else name, end, entry)
                index[c, end, entry] = known.setdefault(key, len(known))
    return _Ties(index, sign, len(known))


def _gather(shape: FloatArray, ties: _Ties) -> FloatArray:
    """Shape parameters (k,) of sections (c, 2, 4): tied entries are averaged."""
    used = ties.index >= 0
    total = np.bincount(ties.index[used], (ties.sign * shape)[used], ties.size)
    return np.asarray(total / np.bincount(ties.index[used], minlength=ties.size))


def _with_shape(body: BodyModel, parameters: FloatArray, ties: _Ties) -> BodyModel:
    shape = body.cone_shape.copy()
    used = ties.index >= 0
    shape[used] = (ties.sign[used]) * parameters[ties.index[used]]
    return replace(body, cone_shape=shape)
