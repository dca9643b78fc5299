"""The residuals of a contour frame as rows, for fits of lengths and sections.

Contour refinement of a pose sums its normal equations without rows.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from markerless_tracker.body import BodyModel, cone_transforms, transforms
from markerless_tracker.body.kinematics import carried, move_axes
from markerless_tracker.body.model import IntArray, is_translation
from markerless_tracker.compiled import inlined, kernel
from markerless_tracker.fitness.contour.floor import SLACK_M, STANDING, robust_weight
from markerless_tracker.fitness.contour.frame import ContourFrame
from markerless_tracker.fitness.soles import ankles, floor_share
from markerless_tracker.geometry import FloatArray


@dataclass(frozen=True, eq=False)
class OutlineRows:
    """The n residuals of all views of a frame.

    Attributes:
        view: (n,) index of the residual's view, ascending; -1 for the floor.
        cone: (n,) index of the cone of the residual's outline point.
        place: (n, 5) the point on the cone, as in `Samples.place`.
        gradient: (n, 3) of the residual with respect to that point, world frame.
        value: (n,) residual, m.
        weight: (n,) factor of the squared residual; of an outline its represented length, m, times
            the robust weight.
    """

    view: IntArray
    cone: IntArray
    place: FloatArray
    gradient: FloatArray
    value: FloatArray
    weight: FloatArray


def outline_rows(frame: ContourFrame) -> OutlineRows:
    """The residuals of the last call of `ContourFrame.collect`."""
    r, samples = frame.residuals, frame.samples
    used = [slice(int(n)) for n in r.count]
    sample = [r.sample[v, rows] for v, rows in enumerate(used)]
    return OutlineRows(
        view=np.repeat(np.arange(len(r.count)), r.count),
        cone=np.concatenate([samples.cone[v, s] for v, s in enumerate(sample)]),
        place=np.concatenate([samples.place[v, s] for v, s in enumerate(sample)]),
        gradient=np.concatenate(
            [r.gradient[v, :, rows] for v, rows in enumerate(used)], axis=1
        ).T.copy(),
        value=np.concatenate([r.value[v, rows] for v, rows in enumerate(used)]),
        weight=np.concatenate([r.weight[v, rows] for v, rows in enumerate(used)]),
    )


def floor_rows(body: BodyModel, pose: FloatArray, weight: float) -> OutlineRows:
    """The residuals of `add_floor` at a pose (p,): of the cones' ends at their lowest points.

    Args:
        body: the body.
        pose: its pose.
        weight: of each residual, before its share and its robust weight.
    """
    placed, shape = cone_transforms(body, pose), body.cone_shape
    down = -placed[:, None, 2, :2] * shape[:, :, :2]
    drop = np.linalg.norm(down, axis=2)
    round_ = np.divide(down, drop[:, :, None], out=np.zeros_like(down), where=drop[:, :, None] > 0)
    ends = np.stack([np.zeros(len(shape)), body.cone_length], axis=1)
    middle = (placed[:, None, 2, :2] * shape[:, :, 2:4]).sum(axis=2)
    low = middle + placed[:, None, 2, 2] * ends + placed[:, None, 2, 3] - drop
    cone, end = np.nonzero(low < -SLACK_M)
    place = np.zeros((len(cone), 5))
    place[np.arange(len(cone)), 2 * end] = round_[cone, end, 0]
    place[np.arange(len(cone)), 2 * end + 1] = round_[cone, end, 1]
    place[:, 4] = end
    share = floor_share(body)[cone, end]
    sunk = _above_floor(cone, place, low[cone, end] + SLACK_M, weight * share)
    feet, height = ankles(body)
    above = middle[feet, 1] + placed[feet, 2, 2] * body.cone_length[feet] + placed[feet, 2, 3]
    above -= height
    deep = above < -SLACK_M
    used = deep | ((above > 0.0) & (above <= above.min(initial=np.inf)))
    at_end = np.tile([0.0, 0.0, 0.0, 0.0, 1.0], (int(used.sum()), 1))
    value = np.where(deep, above + SLACK_M, above)[used]
    return joined_rows(
        sunk, _above_floor(feet[used], at_end, value, weight * np.where(deep, 1.0, STANDING)[used])
    )


def _above_floor(
    cone: IntArray, place: FloatArray, value: FloatArray, weight: FloatArray
) -> OutlineRows:
    """Residuals (n,) of heights; the weights without the robust ones."""
    return OutlineRows(
        view=np.full(len(cone), -1),
        cone=cone,
        place=place,
        gradient=np.tile([0.0, 0.0, 1.0], (len(cone), 1)),
        value=value,
        weight=weight * np.array([robust_weight(each) for each in value]),
    )


def joined_rows(*parts: OutlineRows) -> OutlineRows:
    """The rows of all parts, one part after the other."""
    return OutlineRows(
        *(
            np.concatenate([getattr(part, field.name) for part in parts])
            for field in fields(OutlineRows)
        )
    )


def surface(body: BodyModel, pose: FloatArray, rows: OutlineRows) -> FloatArray:
    """World points (n, 3) at the rows' places on a body at a pose (p,)."""
    out = np.empty((len(rows.cone), 3))
    placed = cone_transforms(body, pose)
    _surface(placed, body.cone_shape, body.cone_length, rows.cone, rows.place, out)
    return out


def pose_jacobian(body: BodyModel, pose: FloatArray, rows: OutlineRows) -> FloatArray:
    """Derivatives (n, p) of the residuals by the parameters of a pose (p,)."""
    placed = transforms(body, pose)
    moved = np.flatnonzero(body.node_kind >= 0)
    axes = move_axes(body, placed, moved)
    out = np.zeros((len(rows.cone), body.size))
    _pose_jacobian(
        surface(body, pose, rows), rows.gradient, axes,
        np.ascontiguousarray(placed[moved, :, 3]), is_translation(body.node_kind[moved]),
        body.node_parameter[moved],
        carried(body, moved)[body.cone_node], rows.cone, out,
    )  # fmt: skip
    return out


def length_jacobian(
    longer: Sequence[BodyModel],
    pose: FloatArray,
    rows: OutlineRows,
    points: FloatArray,
    step: float,
) -> FloatArray:
    """Derivatives (n, k) of the residuals by k lengths, as difference quotients.

    Args:
        longer: for each length, the body with that length changed by `step`.
        pose: (p,).
        rows: the residuals.
        points: (n, 3) their points on the body, world frame.
        step: change of a length, in the unit of the lengths' parameters.
    """
    placed = np.stack([cone_transforms(body, pose) for body in longer])
    lengths = np.stack([body.cone_length for body in longer])
    out = np.empty((len(rows.cone), len(longer)))
    _length_jacobian(
        placed, longer[0].cone_shape, lengths, rows.cone, rows.place, rows.gradient, points,
        1.0 / step, out,
    )  # fmt: skip
    return out


@inlined
def _on_cone(c, place, shape, length):  # type: ignore[no-untyped-def]
    """The point (x, y, z) at a place (5,) on cone c, in the cone's frame."""
    near, far = 1.0 - place[4], place[4]
    x = near * (shape[c, 0, 2] + shape[c, 0, 0] * place[0])
    x += far * (shape[c, 1, 2] + shape[c, 1, 0] * place[2])
    y = near * (shape[c, 0, 3] + shape[c, 0, 1] * place[1])
    y += far * (shape[c, 1, 3] + shape[c, 1, 1] * place[3])
    return x, y, far * length[c]


@kernel
def _length_jacobian(  # type: ignore[no-untyped-def]
    placed, shape, lengths, cone, place, gradient, points, per_step, out
):
    """Fill out (n, k) as `length_jacobian`; placed (k, c, 3, 4), lengths (k, c)."""
    for n in range(cone.size):
        c = cone[n]
        for k in range(placed.shape[0]):
            x, y, z = _on_cone(c, place[n], shape, lengths[k])
            rate = 0.0
            for i in range(3):
                t = placed[k, c, i]
                moved = t[0] * x + t[1] * y + t[2] * z + t[3] - points[n, i]
                rate += gradient[n, i] * moved
            out[n, k] = per_step * rate


@kernel
def _surface(placed, shape, length, cone, place, out):  # type: ignore[no-untyped-def]
    """Fill out (n, 3) with the points at places (n, 5) on cones (n,) at transforms (c, 3, 4)."""
    for n in range(cone.size):
        c = cone[n]
        x, y, z = _on_cone(c, place[n], shape, length)
        for i in range(3):
            t = placed[c, i]
            out[n, i] = t[0] * x + t[1] * y + t[2] * z + t[3]


@kernel
def _pose_jacobian(  # type: ignore[no-untyped-def]
    points, gradient, axes, origins, slides, parameter, hang, cone, out
):
    """Add the derivatives of n residuals by p parameters to out (n, p).

    Args:
        points, gradient: (n, 3) the residuals' points and gradients.
        axes, origins: (m, 3) of the joints' nodes, world frame.
        slides: (m,) whether a node translates; else it rotates.
        parameter: (m,) index of each node's parameter.
        hang: (c, m) not 0 if a node moves a cone.
        cone: (n,) the residuals' cones.
    """
    for n in range(cone.size):
        gx, gy, gz = gradient[n, 0], gradient[n, 1], gradient[n, 2]
        for m in range(slides.size):
            if hang[cone[n], m] == 0.0:
                continue
            x, y, z = axes[m, 0], axes[m, 1], axes[m, 2]
            if not slides[m]:
                # A rotation about the axis moves a point P by axis x (P - origin).
                u, v = points[n, 0] - origins[m, 0], points[n, 1] - origins[m, 1]
                w = points[n, 2] - origins[m, 2]
                x, y, z = y * w - z * v, z * u - x * w, x * v - y * u
            out[n, parameter[m]] += gx * x + gy * y + gz * z
