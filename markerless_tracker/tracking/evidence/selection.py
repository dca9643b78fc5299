"""Selects the components of a silhouette that belong to the tracked body: those near it."""

from dataclasses import replace
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from markerless_tracker.body import BodyModel, cone_transforms
from markerless_tracker.camera import CameraModel, project_camera
from markerless_tracker.compiled import kernel
from markerless_tracker.fitness.raster.components import (
    Components,
    clear_components,
    components,
    touch_components,
)
from markerless_tracker.geometry import FloatArray
from markerless_tracker.imaging import Region
from markerless_tracker.records import Observation

_POINTS_PER_CONE = 6
_THICKEST_PX = 32767
"""OpenCV draws no thicker lines."""
_FAR_PX = 1e4
"""A line with a point farther than this from the region's corner is not drawn."""
HAND_M = 0.07
"""Side of a square. A patch of person pixels with a smaller area is no limb cut off by a region."""


class PlacedCones(NamedTuple):
    """The cones of a body at a pose.

    Attributes:
        points_m: (c, n, 3) along each cone's axis, world frame.
        radii_m: (c,) the largest of each cone.
    """

    points_m: FloatArray
    radii_m: FloatArray


class BodyLines(NamedTuple):
    """A body in one camera's image, as a thick line along each cone.

    Attributes:
        pixels: (c, n, 2) px, NaN behind the camera.
        depths_m: (c,) least depth of each line.
        radii_px: (c,) largest radius of each cone, at that depth.
        focal_px: the camera's focal length.
        size_px: (width, height) of the frame.
    """

    pixels: FloatArray
    depths_m: FloatArray
    radii_px: FloatArray
    focal_px: float
    size_px: tuple[int, int]


def place_cones(body: BodyModel, pose: FloatArray) -> PlacedCones:
    """The cones of a body at a pose (p,)."""
    t = np.linspace(0.0, 1.0, _POINTS_PER_CONE)
    placed = cone_transforms(body, pose)
    ends, shape = body.cone_shape[:, :, 2:], body.cone_shape
    local = np.empty((len(placed), t.size, 3))
    local[:, :, :2] = (1.0 - t)[:, None] * ends[:, None, 0] + t[:, None] * ends[:, None, 1]
    local[:, :, 2] = t * body.cone_length[:, None]
    points_m = local @ placed[:, :3, :3].transpose(0, 2, 1) + placed[:, None, :3, 3]
    return PlacedCones(points_m, shape[:, :, :2].max(axis=(1, 2)))


def body_lines(camera: CameraModel, cones: PlacedCones) -> BodyLines:
    """Placed cones as a camera sees them."""
    points, focal = cones.points_m, float(camera.matrix[0, 0])
    depths_m = (points @ camera.T_cam_world[2, :3] + camera.T_cam_world[2, 3]).min(axis=1)
    pixels = project_camera(points.reshape(-1, 3), camera).reshape(*points.shape[:2], 2)
    with np.errstate(divide="ignore", invalid="ignore"):
        radii_px = focal * cones.radii_m / depths_m
    return BodyLines(pixels, depths_m, radii_px, focal, camera.size_px)


def explained_part(
    observation: Observation, lines: BodyLines, margin_px: int
) -> tuple[Observation, int]:
    """Keep the silhouette's components near the predicted body.

    A component is kept if any of its pixels is nearer than `margin_px` to the body at the predicted
    pose, drawn as `lines`. If none is near (the prediction is wrong), all are kept.

    Returns:
        The observation, the same object if nothing was left out, and the number of pixels left out.
    """
    parts = _components(observation)
    if parts.total <= 1:
        return observation, 0
    kept = _near(parts, observation, lines, margin_px)
    if not kept.any():
        return observation, 0
    return _only(observation, parts, kept)


def explained_in_region(
    observation: Observation, lines: BodyLines, margin_px: int, clear_px: int
) -> tuple[Observation, int] | None:
    """`explained_part` of an observation of a region; None where the whole frame is needed.

    The whole frame is needed if no component with person pixels is near the body. It is also needed
    if a component near the body has person pixels within `clear_px` of a side of the region that is
    no side of the frame: the person may continue beyond it. Undecided pixels at a side do not
    count, since shadows and faint patches continue across the floor; nor do specks of person pixels
    that are smaller than a hand. Components are those of the region: a component that is connected
    to the body's only through undecided pixels outside of the region is left out.
    """
    parts = _components(observation)
    kept = _near(parts, observation, lines, margin_px)
    if not kept.any():
        return None
    part, left_out = _only(observation, parts, kept)
    person = components(part.mask_words)
    if person.total == 0:
        return None
    if _leaves_region(person.box(), observation, clear_px):
        hand_px = lines.focal_px * HAND_M / float(np.median(lines.depths_m))
        larger = person.box(person.areas_px >= hand_px**2)
        if _leaves_region(larger, observation, clear_px):
            return None
    return part, left_out


def _leaves_region(box: Region | None, observation: Observation, clear_px: int) -> bool:
    """Whether a box in the region comes near a side of it that is no side of the frame."""
    if box is None:
        return False
    box = box.moved(*observation.offset_px)
    u, v = observation.offset_px
    region = Region(u, v, u + observation.width, v + observation.height)
    # Grown by `clear_px`, and clipped to the frame, the box must lie inside the region.
    wide = box.grown(clear_px, observation.size_px)
    return (
        wide.left < region.left
        or wide.top < region.top
        or wide.right > region.right
        or wide.bottom > region.bottom
    )


def body_region(lines: BodyLines, margin_m: float, least_px: int) -> Region | None:
    """The part of a camera's frame that holds a body, and a margin around it.

    Args:
        lines: the body in that camera.
        margin_m: margin at the body, all around.
        least_px: smallest margin.

    Returns:
        None if the camera does not see enough of the body.
    """
    pixels, depths_m = lines.pixels, lines.depths_m
    if not np.isfinite(pixels).all() or depths_m.min() <= 0.0:
        return None
    radii_px = lines.radii_px[:, None]
    low = (pixels.min(axis=1) - radii_px).min(axis=0)
    high = (pixels.max(axis=1) + radii_px).max(axis=0)
    margin = max(lines.focal_px * margin_m / float(depths_m.min()), float(least_px))
    left, top = np.floor(np.maximum(low - margin, 0.0))
    right, bottom = np.ceil(np.minimum(high + margin, np.asarray(lines.size_px, dtype=float)))
    if right <= left or bottom <= top:
        return None
    return Region(int(left), int(top), int(right), int(bottom))


def _components(observation: Observation) -> Components:
    """Components of person and undecided pixels."""
    words, undecided = observation.mask_words, observation.undecided_words
    return components(words if undecided is None else words | undecided)


def _near(
    parts: Components, observation: Observation, lines: BodyLines, margin_px: int
) -> NDArray[np.bool_]:
    """(total,) which components are near the body."""
    kept = np.zeros(parts.total, dtype=np.bool_)
    # Mostly the lines' points lie in all components, and nothing needs to be drawn.
    _meet(lines.pixels, observation.offset_px, parts, kept)
    if not kept.all():
        touch_components(parts, _thick_body(observation, lines, margin_px), kept)
    return kept


@kernel
def _meet(pixels, offset, parts, kept):  # type: ignore[no-untyped-def]
    """Mark the components (total,) that the points (c, n, 2) of lines lie in, px of the frame.

    `parts` are the `Components` of a region at `offset`. Lines with a point that is farther than
    `_FAR_PX`, or not finite, are left out.
    """
    height = parts.first.size - 1
    for c in range(pixels.shape[0]):
        drawn = True
        for n in range(pixels.shape[1]):
            u, v = pixels[c, n, 0] - offset[0], pixels[c, n, 1] - offset[1]
            # NaN fails the comparison and is left out, too.
            drawn = drawn and abs(u) <= _FAR_PX and abs(v) <= _FAR_PX
        if not drawn:
            continue
        for n in range(pixels.shape[1]):
            u = np.int64(np.rint(pixels[c, n, 0] - offset[0]))
            v = np.int64(np.rint(pixels[c, n, 1] - offset[1]))
            if not 0 <= v < height:
                continue
            for r in range(parts.first[v], parts.first[v + 1]):
                if parts.begin[r] <= u < parts.end[r]:
                    kept[parts.number[r]] = True


def _only(
    observation: Observation, parts: Components, kept: NDArray[np.bool_]
) -> tuple[Observation, int]:
    if kept.all():
        return observation, 0
    words = observation.mask_words.copy()
    left_out = int(clear_components(parts, kept, words))
    # A shadow away from the body remains undecided: it is no lit floor.
    return replace(observation, mask_words=words), left_out


def _thick_body(observation: Observation, lines: BodyLines, margin_px: int) -> NDArray[np.uint8]:
    """(h, w) 1 at the region's pixels within a margin of the body, else 0."""
    out = np.zeros((observation.height, observation.width), dtype=np.uint8)
    which, points = _drawn(observation, lines)
    for line, radius_px in zip(points, lines.radii_px[which], strict=True):
        thickness = max(1, min(2 * (round(float(radius_px)) + margin_px), _THICKEST_PX))
        cv2.polylines(out, [line.reshape(-1, 1, 2)], False, 1, thickness)
    return out


def _drawn(
    observation: Observation, lines: BodyLines
) -> tuple[NDArray[np.bool_], NDArray[np.int32]]:
    """Which lines (c,) can be drawn, and their points (k, n, 2) in whole pixels of the region."""
    pixels = lines.pixels - observation.offset_px
    # NaN fails the comparison and is left out, too.
    which = np.asarray((np.abs(pixels) <= _FAR_PX).all(axis=(1, 2)))
    return which, np.round(pixels[which]).astype(np.int32)
