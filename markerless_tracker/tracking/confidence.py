"""How sure a pose is: from how firmly the contours hold it, and what the model cannot know.

The normal equations of the contour refinement say how far each parameter may move before the
outlines fit worse (Gauss-Newton approximation of the posterior, noise as large as this frame's
residuals). That is noise only. What the images cannot tell comes on top: where in the flesh the
joint's centre is, and for a person known by the stature only how long the bones are.
"""

import numpy as np

from markerless_tracker.body import BodyModel, markers, root_transform
from markerless_tracker.errors import SearchError
from markerless_tracker.fitness.contours import ContourFrame
from markerless_tracker.fitness.shape import CORRELATION_M
from markerless_tracker.geometry import FloatArray
from markerless_tracker.records import Confidence

MEASURED_M = 0.012
"""Error, per axis, of a joint's centre in a body whose lengths were measured."""
GENERIC_M = 0.020
"""The same with the proportions of a stature."""
CORRELATED = 9.0
"""A generic section is wrong along a whole limb: its residuals agree over some half a metre, not
over the piece of outline that a refinement takes for independent."""
_LEVER_M = 0.25
"""Errors of joints' centres turn limbs about as long as this."""
_REACH_M = 0.035
_LEAST_SIGMA_M = 0.002
_STEP = 1e-5


def confidence_of(
    body: BodyModel, pose: FloatArray, contours: ContourFrame, *, measured: bool
) -> Confidence | None:
    """Standard deviations of a pose (p,); None if the contours do not hold it at all.

    Args:
        body: the tracked body.
        pose: (p,) the estimate.
        contours: the frame's contour evidence.
        measured: whether the body's lengths are the person's own.
    """
    sums = contours.equations(pose, _REACH_M)
    r = contours.residuals
    used = [slice(int(n)) for n in r.count]
    weight = np.concatenate([r.weight[v, rows] for v, rows in enumerate(used)])
    value = np.concatenate([r.value[v, rows] for v, rows in enumerate(used)])
    total = float(weight.sum())
    if total <= 0.0:
        return None
    variance = max(float((weight * value**2).sum()) / total, _LEAST_SIGMA_M**2)
    precision = sums.hessian / (CORRELATED * CORRELATION_M * variance)
    precision[np.diag_indices_from(precision)] += 1.0 / body.spread**2 + 1e-9
    try:
        covariance = np.linalg.inv(precision)
    except np.linalg.LinAlgError:
        return None
    if not np.isfinite(covariance).all():
        raise SearchError("the covariance of the pose is not finite")
    floor = MEASURED_M if measured else GENERIC_M
    by_marker, by_root = _slopes(body, pose)
    of_markers = np.einsum("ij,jk,ik->i", by_marker, covariance, by_marker)
    of_root = by_root @ covariance @ by_root.T
    of_root[np.diag_indices(6)] += np.repeat([floor**2, (floor / _LEVER_M) ** 2], 3)
    moving = body.node_kind[[int(np.flatnonzero(body.node_parameter == k)[0])
                             for k in range(body.size)]] >= 3  # fmt: skip
    floors = np.where(moving, floor, floor / _LEVER_M)
    return Confidence(
        pose_sd=np.sqrt(np.diag(covariance) + floors**2),
        markers_sd_m=np.sqrt(of_markers + floor**2).reshape(-1, 3),
        root_covariance=0.5 * (of_root + of_root.T),
    )


def _slopes(body: BodyModel, pose: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Derivatives by the parameters: of the markers (45, p), of the root's place and turn (6, p).

    The root's turn is a small rotation about the world's axes.
    """
    here, root = markers(body, pose), root_transform(body, pose)
    by_marker = np.empty((here.size, body.size))
    by_root = np.empty((6, body.size))
    for k in range(body.size):
        moved = pose.copy()
        moved[k] += _STEP
        by_marker[:, k] = (markers(body, moved) - here).ravel() / _STEP
        other = root_transform(body, moved)
        turn = other[:3, :3] @ root[:3, :3].T
        by_root[:3, k] = (other[:3, 3] - root[:3, 3]) / _STEP
        by_root[3:, k] = np.array([turn[2, 1], turn[0, 2], turn[1, 0]]) / _STEP
    return by_marker, by_root
