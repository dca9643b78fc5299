"""Regions of silhouette that the body leaves unexplained, and the limbs that may belong there."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray

from markerless_tracker.body import BodyModel, cone_transforms
from markerless_tracker.body.parts import cones_of
from markerless_tracker.camera import CameraModel, CameraRig, project_camera
from markerless_tracker.compiled import kernel
from markerless_tracker.fitness.raster.bits import count_bits
from markerless_tracker.fitness.raster.components import components
from markerless_tracker.fitness.raster.mask_words import cut_words, grow_rows, paste_words
from markerless_tracker.fitness.raster.silhouette import body_words
from markerless_tracker.geometry import FloatArray
from markerless_tracker.observation import locked
from markerless_tracker.records import MaskWords, Observation, unpack_mask
from markerless_tracker.tracking.search import pixels_per_m

MARGIN_M = 0.03
"""Silhouette within this distance of the body is explained: sections and clothes are not exact."""
LEAST_M2 = 0.004
"""Area of the smallest region that counts, at the body's distance: half of a hand."""


@dataclass(frozen=True, eq=False)
class Unexplained:
    """Silhouette that the body does not cover.

    Attributes:
        areas_m2: by limb, the weighted area of the regions that it may belong to, the likeliest
            limb first.
        regions: by camera with such regions, all unexplained pixels (h, w) of its frame.
    """

    areas_m2: Mapping[str, float]
    regions: Mapping[str, NDArray[np.bool_]]


def find_unexplained(
    body: BodyModel,
    pose: FloatArray,
    observations: Mapping[str, Observation],
    rig: CameraRig,
) -> Unexplained:
    """Finds regions of silhouette that a body does not explain, and limbs that may belong there.

    A region counts with its whole area for the nearest limb of those that are long enough to lie in
    it, with half of the area for the second nearest, with a third for the third nearest.

    Args:
        body: the body.
        pose: (p,) its pose.
        observations: the silhouettes.
        rig: the cameras.
    """
    if not body.limbs:
        return Unexplained({}, {})
    axes = _axes(body, pose)
    lengths_m = {name: _length_m(points) for name, points in axes.items()}
    middle = np.concatenate(list(axes.values())).mean(axis=0)
    covered = body_words(body, pose, [rig[name] for name in observations])
    areas: dict[str, float] = {}
    regions: dict[str, NDArray[np.bool_]] = {}
    for name, observation in observations.items():
        camera = rig[name]
        scale = pixels_per_m(camera, middle)
        rest, left_over = _left_over(observation, covered[name], scale)
        if rest is not None:
            regions[name] = observation.in_full_frame(rest)
        for area_px, centre in left_over:
            for rank, limb in enumerate(_long_enough(axes, lengths_m, camera, centre, scale)):
                areas[limb] = areas.get(limb, 0.0) + area_px / scale**2 / (1 + rank)
    likeliest = sorted(areas, key=lambda limb: -areas[limb])
    return Unexplained({limb: areas[limb] for limb in likeliest}, regions)


def _left_over(
    observation: Observation, covered: MaskWords, scale: float
) -> tuple[NDArray[np.bool_] | None, list[tuple[float, FloatArray]]]:
    """Silhouette farther than `MARGIN_M` from the body, and its regions.

    Args:
        observation: the view.
        covered: the body in its frame, packed.
        scale: size of a metre at the body, px.

    Returns:
        The pixels (h, w), and per region of at least `LEAST_M2` its area and centre in px; None and
        an empty list without any such region.
    """
    margin_px, least_px = max(1, round(MARGIN_M * scale)), LEAST_M2 * scale**2
    seen = observation.mask_words
    shape = seen.shape[0] + 2 * margin_px, (observation.width + 2 * margin_px + 63) // 64
    rest, around, near = np.empty_like(seen), np.zeros(shape, np.uint64), np.zeros(shape, np.uint64)
    count = _beyond(
        seen,
        covered,
        *observation.offset_px,
        observation.width,
        _disc(margin_px),
        around,
        near,
        rest,
    )
    if count < least_px:
        return None, []
    parts = components(rest)
    areas_px = parts.areas_px
    found = np.flatnonzero(areas_px >= least_px)
    if not found.size:
        return None, []
    centres = parts.centres_px + observation.offset_px
    regions = [(float(areas_px[n]), np.asarray(centres[n])) for n in found]
    return unpack_mask(rest, observation.width), regions


@cache
def _disc(radius: int) -> NDArray[np.int64]:
    """(2 r + 1,) half the width of each row of a disc, px; read-only."""
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * radius + 1, 2 * radius + 1))
    return np.asarray(locked(disc.sum(axis=1, dtype=np.int64) // 2, np.int64))


@kernel
def _beyond(  # type: ignore[no-untyped-def]
    seen, covered, left, top, width, half_widths, around, near, rest
):
    """Fill `rest` with the silhouette farther from the body than a disc's radius r; count its
    pixels.

    Args:
        seen: (h, k) silhouette in a window of the frame.
        covered: body in the frame, packed.
        left, top: of the window in the frame.
        width: of the window, px.
        half_widths: (2 r + 1,) of the disc.
        around, near: (h + 2 r, m) zeros, for the window and r pixels around it; overwritten.
        rest: (h, k), output.
    """
    radius = half_widths.size // 2
    paste_words(covered, left - radius, top - radius, width + 2 * radius, around)
    grow_rows(around, half_widths, width + 2 * radius, near)
    cut_words(near, radius, radius, width, rest)
    for v in range(rest.shape[0]):
        for w in range(rest.shape[1]):
            rest[v, w] = seen[v, w] & ~rest[v, w]
    return count_bits(rest)


def _axes(body: BodyModel, pose: FloatArray) -> dict[str, FloatArray]:
    """By limb, points (n, 3) at the ends of its cones, m."""
    placed = cone_transforms(body, pose)
    ends = placed[:, :, 3] + body.cone_length[:, None] * placed[:, :, 2]
    axes = {}
    for name in body.limbs:
        hangs = cones_of(body, name)
        axes[name] = np.concatenate([placed[hangs, :, 3], ends[hangs]])
    return axes


def _length_m(points: FloatArray) -> float:
    """Length (m) of a limb along its cones, from the points of `_axes`."""
    starts, ends = points[: len(points) // 2], points[len(points) // 2 :]
    return float(np.linalg.norm(ends - starts, axis=1).sum())


def _long_enough(
    axes: Mapping[str, FloatArray],
    lengths_m: Mapping[str, float],
    camera: CameraModel,
    centre: FloatArray,
    scale: float,
) -> list[str]:
    """Limbs long enough to lie at a region's centre (2,), the nearest first; all if none is.

    A limb at a wrong place may be farther from its own region than another limb.
    """
    gaps = {}
    for name, points in axes.items():
        off = np.linalg.norm(project_camera(points, camera) - centre, axis=1)
        if np.isfinite(off).any():
            gaps[name] = (float(np.nanmin(off)), float(off[0]))
    near = sorted(gaps, key=lambda name: gaps[name][0])
    return [name for name in near if gaps[name][1] <= lengths_m[name] * scale] or near
