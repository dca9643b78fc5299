"""Selects draws of a limb that lie in unexplained regions of silhouette."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.body import BodyModel
from markerless_tracker.body.kinematics import moving_nodes, node_transform
from markerless_tracker.body.model import IntArray
from markerless_tracker.camera import CameraRig
from markerless_tracker.camera.lens import pixel
from markerless_tracker.compiled import kernel
from markerless_tracker.geometry import FloatArray

ALONG = np.array([0.3, 0.6, 0.9])
"""Points along each cone of the limb that are tested, as fractions of its length."""


def most_aimed(
    body: BodyModel,
    poses: FloatArray,
    count: int,
    *,
    limb: IntArray,
    regions: Mapping[str, NDArray[np.bool_]],
    rig: CameraRig,
) -> FloatArray:
    """The `count` poses of (n, p) whose limb lies most in unexplained regions; best first.

    Args:
        body: the body.
        poses: the draws, which differ in the limb only.
        count: number of poses to return; fewer if fewer have a point in a region of any view.
        limb: the limb's parameters.
        regions: by camera, the unexplained pixels (h, w) of its frame.
        rig: the cameras.
    """
    moving = moving_nodes(body, limb)
    cones = np.flatnonzero(moving[body.cone_node])
    points = np.empty((len(poses), len(cones) * ALONG.size, 3))
    _limb_points(
        np.ascontiguousarray(poses), body.node_parent, body.node_fixed, body.node_kind,
        body.node_sign, body.node_parameter, moving, body.cone_node[cones],
        body.cone_fixed[cones], body.cone_length[cones], ALONG,
        np.empty((body.node_parent.size, 3, 4)), points,
    )  # fmt: skip
    hits = np.zeros(len(poses), dtype=np.int64)
    for name, region in regions.items():
        camera = rig[name]
        _count_hits(points, camera.T_cam_world, camera.matrix, camera.distortion, region, hits)
    best = np.argsort(-hits, kind="stable")[:count]
    return poses[best[hits[best] > 0]]


@kernel
def _count_hits(points, to_camera, matrix, distortion, region, hits):  # type: ignore[no-untyped-def]
    """Add to hits (n,) how many of each pose's points (n, k, 3) a view has in a region (h, w)."""
    height, width = region.shape
    for i in range(points.shape[0]):
        for j in range(points.shape[1]):
            u, v = pixel(
                points[i, j, 0], points[i, j, 1], points[i, j, 2], to_camera, matrix, distortion
            )
            if u >= 0.0 and v >= 0.0 and u < width and v < height:
                hits[i] += region[np.int64(v), np.int64(u)]


@kernel
def _limb_points(  # type: ignore[no-untyped-def]
    poses, parent, fixed, kind, sign, parameter, moving, cone_node, cone_fixed, length, along,
    nodes, points,
):  # fmt: skip
    """Fill points (n, c * k, 3): k places along the axes of c cones, at each of n poses.

    Only the `moving` nodes (m,) differ between the poses.
    """
    for i in range(poses.shape[0]):
        for n in range(parent.size):
            if i == 0 or moving[n]:
                node_transform(n, poses[i], parent, fixed, kind, sign, parameter, nodes)
        for c in range(cone_node.size):
            at = nodes[cone_node[c]]
            for k in range(along.size):
                share = along[k] * length[c]
                for j in range(3):
                    value = at[j, 3]
                    for m in range(3):
                        step = cone_fixed[c, m, 3] + share * cone_fixed[c, m, 2]
                        value += at[j, m] * step
                    points[i, c * along.size + k, j] = value
