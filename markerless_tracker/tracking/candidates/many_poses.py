"""Forward kinematics of many poses of a body at once."""

import numpy as np

from markerless_tracker.body import BodyModel
from markerless_tracker.body.kinematics import node_transforms
from markerless_tracker.compiled import kernel
from markerless_tracker.geometry import FloatArray


@kernel
def _fill_transforms(poses, parent, fixed, kind, sign, parameter, out):  # type: ignore[no-untyped-def]
    """Fill out (n, m, 3, 4) with the transforms of all nodes at poses (n, p)."""
    for n in range(poses.shape[0]):
        node_transforms(poses[n], parent, fixed, kind, sign, parameter, out[n])


def transforms_of_many(body: BodyModel, poses: FloatArray) -> FloatArray:
    """World transforms (n, m, 3, 4) of all nodes at poses (n, p)."""
    out = np.empty((len(poses), body.node_parent.size, 3, 4))
    # A copy: kernels are compiled once more for arrays that are read-only.
    _fill_transforms(
        np.array(poses, dtype=np.float64, order="C"), body.node_parent, body.node_fixed,
        body.node_kind, body.node_sign, body.node_parameter, out,
    )  # fmt: skip
    return out


def markers_of_many(body: BodyModel, poses: FloatArray) -> FloatArray:
    """The markers (n, 15, 3) in m, world frame, at poses (n, p)."""
    nodes = transforms_of_many(body, poses)[:, body.marker_node]
    rotated = np.matmul(nodes[..., :3], body.marker_offset[:, :, None])[..., 0]
    return np.asarray(rotated + nodes[..., 3])
