"""Regions of silhouette that the body leaves unexplained, and the limbs that may belong there."""

from collections.abc import Mapping
from dataclasses import dataclass

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
    rest = np.zeros((observation.height, observation.width), dtype=np.bool_)
    box = _box(observation)
    if box is None:
        return rest, []
    reach = max(1, round(MARGIN_M * scale))
    (u, v), (left, top, right, bottom) = observation.offset_px, box
    # The silhouette's box, and around it what may cover it.
    at = max(0, u + left - reach), max(0, v + top - reach)
    around = covered[at[1] : v + bottom + reach, at[0] : u + right + reach]
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1, 2 * reach + 1))
    near = cv2.dilate(np.ascontiguousarray(around).view(np.uint8), disc).view(np.bool_)
    near = near[v + top - at[1] :, u + left - at[0] :][: bottom - top, : right - left]
    words = observation.mask_words[top:bottom, left // 64 :]
    part = unpack_mask(words, right - left) & ~near
    least_px = LEAST_M2 * scale**2
    if np.count_nonzero(part) < least_px:
        return rest, []
    rest[top:bottom, left:right] = part
    count, _, stats, centres = cv2.connectedComponentsWithStats(part.view(np.uint8))
    return rest, [
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
