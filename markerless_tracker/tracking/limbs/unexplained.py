"""Regions of silhouette that the body leaves unexplained, and the limbs that may belong there."""

from collections.abc import Mapping

import cv2
import numpy as np
from numpy.typing import NDArray

from markerless_tracker.body import BodyModel, cone_transforms
from markerless_tracker.body.kinematics import carried
from markerless_tracker.camera import CameraModel, CameraRig, project_camera
from markerless_tracker.fitness.raster.silhouette import body_masks
from markerless_tracker.geometry import FloatArray
from markerless_tracker.records import Observation
from markerless_tracker.tracking.search import pixels_per_m

MARGIN_M = 0.03
"""Silhouette so near to the body is explained: sections and clothes are never exact."""
LEAST_M2 = 0.004
"""Area of the smallest region that counts, at the body: half of a hand."""


def limbs_unexplained(
    body: BodyModel,
    pose: FloatArray,
    observations: Mapping[str, Observation],
    rig: CameraRig,
) -> tuple[str, ...]:
    """Limbs that lie nearest to unexplained regions of silhouette, the largest region first.

    Args:
        body: the body.
        pose: (p,) its pose.
        observations: the silhouettes.
        rig: the cameras.
    """
    if not body.limbs:
        return ()
    axes = _axes(body, pose)
    middle = np.concatenate(list(axes.values())).mean(axis=0)
    masks = body_masks(body, pose, [rig[name] for name in observations])
    areas: dict[str, float] = {}
    for name, observation in observations.items():
        camera = rig[name]
        scale = pixels_per_m(camera, middle)
        left_over = _left_over(observation, masks[name], scale)
        for area_px, centre in left_over:
            limb = _nearest(axes, camera, centre)
            areas[limb] = areas.get(limb, 0.0) + area_px / scale**2
    return tuple(sorted(areas, key=lambda limb: -areas[limb]))


def _left_over(
    observation: Observation, covered: NDArray[np.bool_], scale: float
) -> list[tuple[float, FloatArray]]:
    """Area (px) and centre (2,) of the regions that are farther than the margin from the body."""
    u, v = observation.offset_px
    window = covered[v : v + observation.height, u : u + observation.width]
    side = 2 * max(1, round(MARGIN_M * scale)) + 1
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side))
    near = cv2.dilate(np.ascontiguousarray(window).view(np.uint8), disc).view(np.bool_)
    rest = observation.mask & ~near
    least_px = LEAST_M2 * scale**2
    if np.count_nonzero(rest) < least_px:
        return []
    count, _, stats, centres = cv2.connectedComponentsWithStats(rest.view(np.uint8))
    return [
        (float(stats[n, cv2.CC_STAT_AREA]), centres[n] + observation.offset_px)
        for n in range(1, count)
        if stats[n, cv2.CC_STAT_AREA] >= least_px
    ]


def _axes(body: BodyModel, pose: FloatArray) -> dict[str, FloatArray]:
    """By limb, points (n, 3) at the ends of its cones, m."""
    placed = cone_transforms(body, pose)
    ends = placed[:, :, 3] + body.cone_length[:, None] * placed[:, :, 2]
    axes = {}
    for name in body.limbs:
        nodes = np.flatnonzero(np.isin(body.node_parameter, body.subspaces[name]))
        hangs = carried(body, nodes)[body.cone_node].any(axis=1)
        axes[name] = np.concatenate([placed[hangs, :, 3], ends[hangs]])
    return axes


def _nearest(axes: Mapping[str, FloatArray], camera: CameraModel, centre: FloatArray) -> str:
    def gap(name: str) -> float:
        return float(np.nanmin(np.linalg.norm(project_camera(axes[name], camera) - centre, axis=1)))

    return min(axes, key=gap)
