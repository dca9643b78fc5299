"""Regions of silhouette that the body leaves unexplained, and the limbs that may belong there."""

from collections.abc import Mapping
from dataclasses import dataclass

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


@dataclass(frozen=True, eq=False)
class Unexplained:
    """Silhouette that the body does not cover.

    Attributes:
        limbs: that may belong there, the likeliest first.
        regions: by camera with such a region, the pixels (h, w) of its frame.
    """

    limbs: tuple[str, ...]
    regions: Mapping[str, NDArray[np.bool_]]


def limbs_unexplained(
    body: BodyModel,
    pose: FloatArray,
    observations: Mapping[str, Observation],
    rig: CameraRig,
) -> tuple[str, ...]:
    """Limbs that may belong to unexplained regions of silhouette, the likeliest first.

    A region counts by its area for the limb nearest to it, by half of it for the second, by a third
    for the third of those that are long enough to lie there.

    Args:
        body: the body.
        pose: (p,) its pose.
        observations: the silhouettes.
        rig: the cameras.
    """
    return look_unexplained(body, pose, observations, rig).limbs


def look_unexplained(
    body: BodyModel,
    pose: FloatArray,
    observations: Mapping[str, Observation],
    rig: CameraRig,
) -> Unexplained:
    """As `limbs_unexplained`, with the regions."""
    if not body.limbs:
        return Unexplained((), {})
    axes = _axes(body, pose)
    reach = {name: _reach(points) for name, points in axes.items()}
    middle = np.concatenate(list(axes.values())).mean(axis=0)
    masks = body_masks(body, pose, [rig[name] for name in observations])
    areas: dict[str, float] = {}
    regions: dict[str, NDArray[np.bool_]] = {}
    for name, observation in observations.items():
        camera = rig[name]
        scale = pixels_per_m(camera, middle)
        rest, left_over = _left_over(observation, masks[name], scale)
        if left_over:
            regions[name] = observation.in_full_frame(rest)
        for area_px, centre in left_over:
            for rank, limb in enumerate(_within_reach(axes, reach, camera, centre, scale)):
                areas[limb] = areas.get(limb, 0.0) + area_px / scale**2 / (1 + rank)
    return Unexplained(tuple(sorted(areas, key=lambda limb: -areas[limb])), regions)


def _left_over(
    observation: Observation, covered: NDArray[np.bool_], scale: float
) -> tuple[NDArray[np.bool_], list[tuple[float, FloatArray]]]:
    """Pixels (h, w) farther than the margin from the body; their regions' areas and centres."""
    u, v = observation.offset_px
    window = covered[v : v + observation.height, u : u + observation.width]
    side = 2 * max(1, round(MARGIN_M * scale)) + 1
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side))
    near = cv2.dilate(np.ascontiguousarray(window).view(np.uint8), disc).view(np.bool_)
    rest = observation.mask & ~near
    least_px = LEAST_M2 * scale**2
    if np.count_nonzero(rest) < least_px:
        return rest, []
    count, _, stats, centres = cv2.connectedComponentsWithStats(rest.view(np.uint8))
    return rest, [
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


def _reach(points: FloatArray) -> float:
    """Length (m) of a limb along its cones, from points at both ends of each."""
    starts, ends = points[: len(points) // 2], points[len(points) // 2 :]
    return float(np.linalg.norm(ends - starts, axis=1).sum())


def _within_reach(
    axes: Mapping[str, FloatArray],
    reach: Mapping[str, float],
    camera: CameraModel,
    centre: FloatArray,
    scale: float,
) -> list[str]:
    """Limbs that are long enough for a region (2,), the nearest first; all if none is.

    A limb at a wrong place may be far from its own region, and another limb nearer.
    """
    gaps = {}
    for name, points in axes.items():
        off = np.linalg.norm(project_camera(points, camera) - centre, axis=1)
        if np.isfinite(off).any():
            gaps[name] = (float(np.nanmin(off)), float(off[0]))
    near = sorted(gaps, key=lambda name: gaps[name][0])
    return [name for name in near if gaps[name][1] <= reach[name] * scale] or near
