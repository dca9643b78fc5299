"""Regions of silhouette that the body leaves unexplained, and the limbs that may belong there."""

from collections.abc import Mapping

import cv2
import numpy as np
from numpy.typing import NDArray

from markerless_tracker.body import BodyModel, cone_transforms
from markerless_tracker.body.parts import cones_of
from markerless_tracker.camera import CameraModel, CameraRig, project_camera
from markerless_tracker.fitness.raster.silhouette import body_masks
from markerless_tracker.geometry import FloatArray
from markerless_tracker.records import Observation, unpack_mask
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
    box = _box(observation)
    if box is None:
        return []
    reach = max(1, round(MARGIN_M * scale))
    (u, v), (left, top, right, bottom) = observation.offset_px, box
    # The silhouette's box, and around it what may cover it.
    at = max(0, u + left - reach), max(0, v + top - reach)
    around = covered[at[1] : v + bottom + reach, at[0] : u + right + reach]
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1, 2 * reach + 1))
    near = cv2.dilate(np.ascontiguousarray(around).view(np.uint8), disc).view(np.bool_)
    near = near[v + top - at[1] :, u + left - at[0] :][: bottom - top, : right - left]
    words = observation.mask_words[top:bottom, left // 64 :]
    rest = unpack_mask(words, right - left) & ~near
    least_px = LEAST_M2 * scale**2
    if np.count_nonzero(rest) < least_px:
        return []
    count, _, stats, centres = cv2.connectedComponentsWithStats(rest.view(np.uint8))
    return [
        (float(stats[n, cv2.CC_STAT_AREA]), centres[n] + (u + left, v + top))
        for n in range(1, count)
        if stats[n, cv2.CC_STAT_AREA] >= least_px
    ]


def _box(observation: Observation) -> tuple[int, int, int, int] | None:
    """Left, top, right and bottom of a region's silhouette, px, ends excluded; None without one.

    Left and right are those of words of 64 pixels.
    """
    words = observation.mask_words
    rows, columns = np.flatnonzero(words.any(axis=1)), np.flatnonzero(words.any(axis=0))
    if rows.size == 0:
        return None
    right = min(observation.width, 64 * (int(columns[-1]) + 1))
    return 64 * int(columns[0]), int(rows[0]), right, int(rows[-1]) + 1


def _axes(body: BodyModel, pose: FloatArray) -> dict[str, FloatArray]:
    """By limb, points (n, 3) at the ends of its cones, m."""
    placed = cone_transforms(body, pose)
    ends = placed[:, :, 3] + body.cone_length[:, None] * placed[:, :, 2]
    axes = {}
    for name in body.limbs:
        hangs = cones_of(body, name)
        axes[name] = np.concatenate([placed[hangs, :, 3], ends[hangs]])
    return axes


def _nearest(axes: Mapping[str, FloatArray], camera: CameraModel, centre: FloatArray) -> str:
    def gap(name: str) -> float:
        return float(np.nanmin(np.linalg.norm(project_camera(axes[name], camera) - centre, axis=1)))

    return min(axes, key=gap)
