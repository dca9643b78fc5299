"""Forward kinematics of many poses of a body at once."""

import numpy as np

from markerless_tracker.body import BodyModel
from markerless_tracker.body.kinematics import node_transforms
from markerless_tracker.geometry import FloatArray


def transforms_of_many(body: BodyModel, poses: FloatArray) -> FloatArray:
    """World transforms (n, m, 3, 4) of all nodes at poses (n, p)."""
    poses = np.ascontiguousarray(poses, dtype=np.float64)
    out = np.empty((len(poses), body.node_parent.size, 3, 4))
    arrays = (
        body.node_parent, body.node_fixed, body.node_kind, body.node_sign, body.node_parameter
    )  # fmt: skip
    for pose, nodes in zip(poses, out, strict=True):
        node_transforms(pose, *arrays, nodes)
    return out


def markers_of_many(body: BodyModel, poses: FloatArray) -> FloatArray:
    """The markers (n, 15, 3) in m, world frame, at poses (n, p)."""
    nodes = transforms_of_many(body, poses)[:, body.marker_node]
    rotated = np.matmul(nodes[..., :3], body.marker_offset[:, :, None])[..., 0]
    return np.asarray(rotated + nodes[..., 3])
