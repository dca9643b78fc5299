"""Uncertainty of a pose: posterior covariance of the contour refinement, and model error.

The inverse normal equations of the contour refinement, scaled by the variance of this frame's
residuals, are the Gauss-Newton approximation of the posterior covariance. It accounts for noise
only. Two errors are added to it. One is the disagreement between the views. The other is what
images do not show: where the joint's centre lies inside the limb, and the lengths, if they were not
measured. Then a joint is less sure along its limb than across, since its outline is nearly the same
there.

A limb at a wrong optimum has a well-determined pose, so its covariance does not show the error.
Three things do. If the search of a limb finds another place that costs nearly as much, the limb may
as well be there (`limbs.rivals`). Its residuals are larger than those of a limb that fits: an error
that grows with their excess is added to the limb's markers, one with the trunk's to all markers.
Silhouette that the body leaves unexplained tells of a limb that is folded into the trunk.
Undecided pixels give no residuals, hence no information.

When a straight limb rotates about its own axis, its outline moves less than the model's error. Of
that rotation only the part that a bent knee or elbow shows is taken as observed.
"""

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.body import MARKER_NAMES, BodyModel, markers, transforms
from markerless_tracker.body.angles.swing import straightness, twists
from markerless_tracker.body.kinematics import carried, move_axes
from markerless_tracker.body.model import is_translation
from markerless_tracker.body.parts import cones_of
from markerless_tracker.compiled import kernel
from markerless_tracker.fitness.contour import ContourFrame, OutlineRows, outline_rows
from markerless_tracker.fitness.shape import CORRELATION_M
from markerless_tracker.geometry import FloatArray
from markerless_tracker.records import Confidence
from markerless_tracker.tracking.limbs.rivals import Rival

MEASURED_M = 0.002
"""Error, per axis, of a joint's centre in a body whose lengths were measured."""
UNMEASURED_M = 0.010
"""The same with lengths that were fitted, or derived from a stature."""
ALONG_M = 0.020
"""Further error along the limb, or along the trunk, of such a body."""
DISAGREEMENT_FACTOR = 1.4
"""Error of a pose relative to the disagreement of the views that remains after the fit."""
CORRELATED = 7.0
"""Factor of the residuals' correlation length. The error of a generic section extends along a whole
limb, about half a metre, which is longer than the pieces of outline that the refinement treats as
independent."""
LIMB_FITTING_M, TRUNK_FITTING_M = 0.009, 0.008
"""Root mean square of the residuals of a limb that fits, and of a trunk that fits."""
LIMB_ERROR_FACTOR = 25.0
"""Error of a limb's end relative to the excess of its residuals over those of a limb that fits."""
SUSPECTED_FACTOR = 0.5
"""Error of a limb's end relative to the size of unexplained silhouette that it may belong to."""
MOST_LIMB_M = 0.30
"""Largest error that is inferred from either: about the length of a segment."""
TRUNK_ERROR_FACTOR = 3.0
"""Error of all markers relative to the excess of the trunk's residuals."""
_LEVER_M = 0.25
"""Length of a limb, which converts an error of a joint's centre into an error of its angle."""
_TRUNCATION_M = 0.06
_SEGMENTS = {
    **dict.fromkeys(("Pelvis", "Neck", "LShoulder", "RShoulder"), ("Pelvis", "Neck")),
    "Head": ("Neck", "Head"),
    **{
        f"{side}{joint}": (f"{side}{start}", f"{side}{end}")
        for side in "LR"
        for joint, start, end in (
            ("Elbow", "Shoulder", "Elbow"), ("Wrist", "Elbow", "Wrist"), ("Hip", "Hip", "Knee"),
            ("Knee", "Hip", "Knee"), ("Ankle", "Knee", "Ankle"),
        )
    },
}  # fmt: skip
_ALONG = np.array([[MARKER_NAMES.index(end) for end in _SEGMENTS[n]] for n in MARKER_NAMES])
"""Per marker: the markers at the ends of the segment along which it is less sure."""
_LEAST_SIGMA_M = 0.002


def confidence_of(
    body: BodyModel,
    pose: FloatArray,
    contours: ContourFrame,
    *,
    measured: bool,
    suspected_m: Mapping[str, float] = MappingProxyType({}),
    rivals: Mapping[str, Rival] = MappingProxyType({}),
) -> Confidence | None:
    """Standard deviations of a pose (p,); None if the contours do not determine it.

    Never raises: None if it cannot be computed.

    Args:
        body: the tracked body.
        pose: (p,) the estimate.
        contours: the frame's contour evidence.
        measured: whether the body's lengths are the person's own.
        suspected_m: by limb, the size of unexplained silhouette that it may belong to.
        rivals: by limb, another place that explains the images nearly as well.
    """
    hessian, rows = contours.equations(pose, _TRUNCATION_M).hessian, outline_rows(contours)
    covariance = _covariance(body, pose, hessian, rows)
    if covariance is None:
        return None
    unseen = MEASURED_M if measured else UNMEASURED_M
    by_limb, of_trunk = excesses_m(body, rows)
    between = DISAGREEMENT_FACTOR * disagreement_m(contours, rows)
    common_sd = float(np.linalg.norm([unseen, between, TRUNK_ERROR_FACTOR * of_trunk]))
    by_marker, by_root = jacobians(body, pose)
    of_markers = ((by_marker @ covariance) * by_marker).sum(axis=1)
    limbs_m = {
        name: min(
            max(LIMB_ERROR_FACTOR * excess, SUSPECTED_FACTOR * suspected_m.get(name, 0.0)),
            MOST_LIMB_M,
        )
        for name, excess in by_limb.items()
    }
    of_limbs, of_pose = _spread(body, by_marker, limbs_m)
    of_model_m = of_limbs[:, None] + common_sd**2
    if not measured:
        of_model_m = of_model_m + (ALONG_M * directions(markers(body, pose))) ** 2
    for rival in rivals.values():
        of_model_m = of_model_m + rival.probability * rival.moved_m**2
        of_pose += rival.probability * rival.moved**2
    of_root = by_root @ covariance @ by_root.T
    of_root[np.diag_indices(6)] += np.repeat([common_sd**2, (common_sd / _LEVER_M) ** 2], 3)
    common_sds = np.full(body.size, common_sd / _LEVER_M)
    common_sds[body.translations] = common_sd
    of_model = np.diag(common_sds**2 + of_pose)
    return Confidence(
        pose_sd=np.sqrt(np.diag(covariance) + common_sds**2 + of_pose),
        pose_covariance=covariance + of_model,
        markers_sd_m=np.sqrt(of_markers.reshape(-1, 3) + of_model_m),
        root_covariance=0.5 * (of_root + of_root.T),
    )


def _covariance(
    body: BodyModel, pose: FloatArray, hessian: FloatArray, rows: OutlineRows
) -> FloatArray | None:
    """Covariance (p, p) from the curvature of the contours' cost; None if it is not determined.

    Args:
        body: the body.
        pose: (p,) the estimate.
        hessian: (p, p) of the cost at the pose.
        rows: the contours' residuals there.
    """
    total, weight, value = float(rows.weight.sum()), rows.weight, rows.value
    if not (total > 0.0 and np.isfinite(value).all() and np.isfinite(hessian).all()):
        return None
    variance = max(float((weight * value**2).sum()) / total, _LEAST_SIGMA_M**2)
    seen = np.ones(body.size)
    seen[twists(body)] = np.sqrt(1.0 - straightness(body, pose))
    precision = np.outer(seen, seen) * hessian / (CORRELATED * CORRELATION_M * variance)
    precision[np.diag_indices_from(precision)] += 1.0 / body.prior_sd**2 + 1e-9
    try:
        covariance = np.linalg.inv(precision)
    except np.linalg.LinAlgError:
        return None
    if not (np.isfinite(covariance).all() and np.diag(covariance).min() >= 0.0):
        return None
    return np.asarray(covariance)


def disagreement_m(contours: ContourFrame, rows: OutlineRows) -> float:
    """Disagreement of the views: distance of their silhouettes from the body after the fit, m.

    For each view, the shift at the body is estimated with which its outline would fit the
    silhouette. The result is the root mean square over views and both axes of the images.

    Args:
        contours: residuals collected at the pose.
        rows: the same residuals, as rows.
    """
    rotation = contours.views.arrays.rotation
    normal, right = np.zeros((len(rotation), 2, 2)), np.zeros((len(rotation), 2))
    _sum_shifts(rows.view, rows.gradient, rows.weight, rows.value, rotation, normal, right)
    trace = normal[:, 0, 0] + normal[:, 1, 1]
    determinant = normal[:, 0, 0] * normal[:, 1, 1] - normal[:, 0, 1] * normal[:, 1, 0]
    # The determinant is the product of the eigenvalues; the trace is no less than the larger one.
    known = determinant > 2.0 * float(np.finfo(np.float64).eps) * trace**2
    if not known.any():
        return 0.0
    shifts = np.linalg.solve(normal[known], right[known][:, :, None])
    return float(np.sqrt(np.mean(shifts**2)))


@kernel
def _sum_shifts(view, gradient, weight, value, rotation, normal, right):  # type: ignore[no-untyped-def]
    """Add the normal equations (v, 2, 2) and (v, 2) of shifts along the axes of v images."""
    for n in range(view.size):
        r = rotation[view[n]]
        x = gradient[n, 0] * r[0, 0] + gradient[n, 1] * r[0, 1] + gradient[n, 2] * r[0, 2]
        y = gradient[n, 0] * r[1, 0] + gradient[n, 1] * r[1, 1] + gradient[n, 2] * r[1, 2]
        a, b = normal[view[n]], right[view[n]]
        a[0, 0] += weight[n] * x * x
        a[0, 1] += weight[n] * x * y
        a[1, 0] += weight[n] * x * y
        a[1, 1] += weight[n] * y * y
        b[0] += weight[n] * value[n] * x
        b[1] += weight[n] * value[n] * y


def excesses_m(body: BodyModel, rows: OutlineRows) -> tuple[dict[str, float], float]:
    """Excess of the residuals over those of a body that fits, m: by limb, and of the trunk.

    The excess is that of the root mean square over the outline points of a limb. The trunk has the
    points that belong to no limb and not to the head.

    Args:
        body: the body.
        rows: residuals collected at the pose.
    """
    count = len(body.cone_node)
    weight = np.bincount(rows.cone, rows.weight, count)
    square = np.bincount(rows.cone, rows.weight * rows.value**2, count)

    def excess(cones: NDArray[np.bool_], fitting_m: float) -> float:
        total = float(weight[cones].sum())
        rms = float(np.sqrt(square[cones].sum() / total)) if total > 0.0 else 0.0
        return max(rms - fitting_m, 0.0)

    hangs = {name: cones_of(body, name) for name in (*body.limbs, "head") if name in body.subspaces}
    trunk = np.ones(count, dtype=np.bool_)
    for others in hangs.values():
        trunk &= ~others
    limbs = {name: excess(hangs[name], LIMB_FITTING_M) for name in body.limbs}
    return limbs, excess(trunk, TRUNK_FITTING_M)


def directions(markers_m: FloatArray) -> FloatArray:
    """Unit vectors (15, 3) along the limb or the trunk of each marker (15, 3); 0 if it has none."""
    along = markers_m[_ALONG[:, 1]] - markers_m[_ALONG[:, 0]]
    length_m = np.linalg.norm(along, axis=1, keepdims=True)
    return np.asarray(along / np.maximum(length_m, 1e-9))


def _spread(
    body: BodyModel, by_marker: FloatArray, errors: Mapping[str, float]
) -> tuple[FloatArray, FloatArray]:
    """Variances of the markers (15,) and of the pose (p,) due to errors of the limbs' ends (m).

    The error of a marker is proportional to how far the limb's parameters move it.
    """
    of_markers, of_pose = np.zeros(len(by_marker) // 3), np.zeros(body.size)
    for name, error in errors.items():
        own = body.subspaces[name]
        lever = np.linalg.norm(by_marker.reshape(len(of_markers), 3, -1)[:, :, own], axis=(1, 2))
        longest = float(lever.max())
        if longest > 0.0:
            of_markers += (error * lever / longest) ** 2
            of_pose[own] += (error / longest) ** 2
    return of_markers, of_pose


def jacobians(body: BodyModel, pose: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Jacobians at a pose (p,): of the markers (45, p) and of the root's pose (6, p).

    The root's rotation is expressed as a rotation vector about the world's axes.
    """
    nodes = transforms(body, pose)
    root = body.frames[body.root_frame]
    points = np.concatenate([markers(body, pose), nodes[root, None, :, 3]])
    moved = np.flatnonzero(body.node_kind >= 0)
    out = np.zeros((len(points) + 1, 3, body.size))
    _fill_jacobian(
        points, move_axes(body, nodes, moved), np.ascontiguousarray(nodes[moved, :, 3]),
        is_translation(body.node_kind[moved]), body.node_parameter[moved],
        carried(body, moved)[[*body.marker_node, root]], out,
    )  # fmt: skip
    return out[:-2].reshape(-1, body.size), out[-2:].reshape(-1, body.size)


@kernel
def _fill_jacobian(points, axes, origins, slides, parameter, hang, out):  # type: ignore[no-untyped-def]
    """Add the derivatives of k points, and of the last point's rotation, to out (k + 1, 3, p).

    Args:
        points: (k, 3).
        axes, origins: (m, 3) of the joints' nodes, world frame.
        slides: (m,) whether a node translates; else it rotates.
        parameter: (m,) index of each node's parameter.
        hang: (k, m) not 0 if a node moves a point.
        out: zeros.
    """
    last = points.shape[0] - 1
    for k in range(last + 1):
        for m in range(slides.size):
            if hang[k, m] == 0.0:
                continue
            x, y, z = axes[m, 0], axes[m, 1], axes[m, 2]
            if not slides[m]:
                if k == last:
                    for i in range(3):
                        out[last + 1, i, parameter[m]] += axes[m, i]
                # A rotation about the axis moves a point P by axis x (P - origin).
                u, v = points[k, 0] - origins[m, 0], points[k, 1] - origins[m, 1]
                w = points[k, 2] - origins[m, 2]
                x, y, z = y * w - z * v, z * u - x * w, x * v - y * u
            out[k, 0, parameter[m]] += x
            out[k, 1, parameter[m]] += y
            out[k, 2, parameter[m]] += z
