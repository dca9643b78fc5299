"""The residuals of a contour frame one by one, for fits of more than a pose.

Contour refinement sums its normal equations without ever writing down a row. Fits of lengths and
sections happen rarely and want the rows.
"""

from dataclasses import dataclass

import numpy as np

from markerless_tracker.body import BodyModel, cone_transforms, transforms
from markerless_tracker.body.kinematics import carried
from markerless_tracker.body.model import IntArray
from markerless_tracker.fitness.contours import ContourFrame
from markerless_tracker.geometry import FloatArray

_SLIDES = 3
"""Kinds of nodes from here on are translations."""


@dataclass(frozen=True, eq=False)
class OutlineRows:
    """The n residuals of all views of a frame.

    Attributes:
        cone: (n,) the cone that a residual's outline point lies on.
        place: (n, 5) where on the cone, as `Samples.shape`.
        gradient: (n, 3) of the residual with respect to that point in the world.
        value: (n,) residual, m.
        weight: (n,) length of outline it stands for, m, times its robust weight.
    """

    cone: IntArray
    place: FloatArray
    gradient: FloatArray
    value: FloatArray
    weight: FloatArray


def outline_rows(frame: ContourFrame) -> OutlineRows:
    """What `ContourFrame.collect` collected last."""
    r, samples = frame.residuals, frame.samples
    used = [slice(int(n)) for n in r.count]
    sample = [r.sample[v, rows] for v, rows in enumerate(used)]
    return OutlineRows(
        cone=np.concatenate([samples.cone[v, s] for v, s in enumerate(sample)]),
        place=np.concatenate([samples.shape[v, s] for v, s in enumerate(sample)]),
        gradient=np.concatenate([r.gradient[v, rows] for v, rows in enumerate(used)]),
        value=np.concatenate([r.value[v, rows] for v, rows in enumerate(used)]),
        weight=np.concatenate([r.weight[v, rows] for v, rows in enumerate(used)]),
    )


def surface(body: BodyModel, pose: FloatArray, rows: OutlineRows) -> FloatArray:
    """World points (n, 3) at the rows' places on a body at a pose (p,)."""
    placed = cone_transforms(body, pose)[rows.cone]
    ends = []
    for end in range(2):
        rx, ry, ox, oy = np.moveaxis(body.cone_shape[rows.cone, end], 1, 0)
        cos, sin = rows.place[:, 2 * end], rows.place[:, 2 * end + 1]
        along = end * body.cone_length[rows.cone]
        ends.append(np.stack([ox + rx * cos, oy + ry * sin, along], axis=1))
    t = rows.place[:, 4:]
    local = (1.0 - t) * ends[0] + t * ends[1]
    return np.asarray(np.einsum("nij,nj->ni", placed[:, :, :3], local) + placed[:, :, 3])


def pose_slopes(body: BodyModel, pose: FloatArray, rows: OutlineRows) -> FloatArray:
    """Derivatives (n, p) of the residuals by the parameters of a pose (p,)."""
    placed = transforms(body, pose)
    moved = np.flatnonzero(body.node_kind >= 0)
    kind = body.node_kind[moved]
    axes = body.node_sign[moved, None] * placed[moved, :, kind % 3]
    # A turn about an axis a through o moves a point P by a x (P - o): along the gradient g that
    # is a.(P x g) - g.(a x o).
    moments = np.cross(surface(body, pose, rows), rows.gradient)
    turns = moments @ axes.T - rows.gradient @ np.cross(axes, placed[moved, :, 3]).T
    slopes = np.where(kind >= _SLIDES, rows.gradient @ axes.T, turns)
    slopes *= carried(body, moved)[body.cone_node[rows.cone]]
    parameter = np.eye(body.size)[body.node_parameter[moved]]
    return np.asarray(slopes @ parameter)
