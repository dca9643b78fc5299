"""Draws of a limb that reach into unexplained regions of silhouette."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.body import BodyModel
from markerless_tracker.body.kinematics import moving_nodes, node_transforms
from markerless_tracker.body.model import IntArray
from markerless_tracker.camera import CameraRig, project_camera
from markerless_tracker.compiled import kernel
from markerless_tracker.geometry import FloatArray

ALONG = np.array([0.3, 0.6, 0.9])
"""Places along each cone of the limb, as shares of its length, that count."""


def most_aimed(
    body: BodyModel,
    poses: FloatArray,
    count: int,
    *,
    limb: IntArray,
    regions: Mapping[str, NDArray[np.bool_]],
    rig: CameraRig,
) -> FloatArray:
    """Those `count` of the poses (n, p) whose limb lies most in unexplained regions; best first.

    Args:
        body: the body.
        poses: differ in the limb alone.
        count: how many are kept; fewer if fewer reach into a region in any view.
        limb: the limb's parameters.
        regions: by camera, the unexplained pixels (h, w) of its frame.
        rig: the cameras.
    """
    cones = np.flatnonzero(moving_nodes(body, limb)[body.cone_node])
    points = np.empty((len(poses), len(cones) * ALONG.size, 3))
    _limb_points(
        np.ascontiguousarray(poses), body.node_parent, body.node_fixed, body.node_kind,
        body.node_sign, body.node_parameter, body.cone_node[cones], body.cone_fixed[cones],
        body.cone_length[cones], ALONG, np.empty((body.node_parent.size, 3, 4)), points,
    )  # fmt: skip
    hits = np.zeros(len(poses))
    for name, region in regions.items():
        pixels = np.round(project_camera(points.reshape(-1, 3), rig[name]))
        height, width = region.shape
        with np.errstate(invalid="ignore"):
            inside = (pixels >= 0.0).all(axis=1) & (pixels < (width, height)).all(axis=1)
        hit = np.zeros(len(pixels), dtype=np.bool_)
        u, v = pixels[inside].astype(np.int64).T
        hit[inside] = region[v, u]
        hits += hit.reshape(len(poses), -1).sum(axis=1)
    best = np.argsort(-hits, kind="stable")[:count]
    return poses[best[hits[best] > 0.0]]


@kernel
def _limb_points(  # type: ignore[no-untyped-def]
    poses, parent, fixed, kind, sign, parameter, cone_node, cone_fixed, length, along, nodes, points
):
    """Fill points (n, c * k, 3) at k places along the axes of c cones, of each of n poses."""
    for i in range(poses.shape[0]):
        node_transforms(poses[i], parent, fixed, kind, sign, parameter, nodes)
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
