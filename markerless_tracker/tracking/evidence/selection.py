"""Which parts of a silhouette are the tracked body's: the components that the prediction meets."""

import cv2
import numpy as np
from numpy.typing import NDArray

from markerless_tracker.body import BodyModel, cone_transforms
from markerless_tracker.camera import CameraModel, project_camera
from markerless_tracker.geometry import FloatArray
from markerless_tracker.imaging import Region
from markerless_tracker.records import Observation

_POINTS_PER_CONE = 6


def explained_part(
    observation: Observation, camera: CameraModel, body: BodyModel, pose: FloatArray, margin_px: int
) -> tuple[Observation, int]:
    """Keep the silhouette's components that come near to the predicted body.

    A component stays if any of its pixels is nearer than `margin_px` to the body at the pose, drawn
    as thick lines along its cones. If none is (the prediction is elsewhere), all stay.

    Returns:
        The observation, the very same if nothing was left out, and the number of pixels left out.
    """
    count, labels = _components(observation)
    if count <= 2:
        return observation, 0
    kept = _near(labels, count, observation, camera, body, pose, margin_px)
    if not kept.any():
        return observation, 0
    return _only(observation, labels, kept)


def explained_in_region(
    observation: Observation,
    camera: CameraModel,
    body: BodyModel,
    pose: FloatArray,
    margin_px: int,
    clear_px: int,
) -> tuple[Observation, int] | None:
    """`explained_part` of an observation of a region; None where the whole frame is needed.

    That is so if no component is near to the body, or if one that is comes nearer than `clear_px`
    to a side of the region beyond which the frame goes on: it may go on there too. Otherwise the
    components kept are those that would be kept of the whole frame.
    """
    count, labels = _components(observation)
    kept = _near(labels, count, observation, camera, body, pose, margin_px)
    if not kept.any():
        return None
    part, left_out = _only(observation, labels, kept)
    left, top, width, height = cv2.boundingRect(kept[labels].view(np.uint8))
    box = Region(left, top, left + width, top + height).moved(*observation.offset_px)
    u, v = observation.offset_px
    region = Region(u, v, u + observation.width, v + observation.height)
    # Grown by that much it must stay inside, but for what the frame itself cuts off.
    wide = box.grown(clear_px, observation.size_px)
    cut = (
        wide.left < region.left
        or wide.top < region.top
        or wide.right > region.right
        or wide.bottom > region.bottom
    )
    return None if cut else (part, left_out)


def body_region(
    camera: CameraModel, body: BodyModel, pose: FloatArray, margin_m: float, least_px: int
) -> Region | None:
    """The part of a camera's frame that holds a body at a pose (p,), and a margin around it.

    Args:
        margin_m: margin at the body, all around.
        least_px: smallest margin.

    Returns:
        None if the camera does not see enough of the body.
    """
    focal = float(camera.matrix[0, 0])
    pixels, depths_m, radii_m = _cone_lines(camera, body, pose)
    if not np.isfinite(pixels).all() or depths_m.min() <= 0.0:
        return None
    radii_px = (focal * radii_m / depths_m)[:, None]
    low = (pixels.min(axis=1) - radii_px).min(axis=0)
    high = (pixels.max(axis=1) + radii_px).max(axis=0)
    margin = max(focal * margin_m / float(depths_m.min()), float(least_px))
    left, top = np.floor(np.maximum(low - margin, 0.0))
    right, bottom = np.ceil(np.minimum(high + margin, np.asarray(camera.size_px, dtype=float)))
    if right <= left or bottom <= top:
        return None
    return Region(int(left), int(top), int(right), int(bottom))


def _components(observation: Observation) -> tuple[int, NDArray[np.int32]]:
    """Components of what is person or undecided: count, and label of each pixel (h, w)."""
    mask = observation.not_background.view(np.uint8)
    count, labels = cv2.connectedComponents(mask, connectivity=8, ltype=cv2.CV_32S)
    return count, np.asarray(labels)


def _near(
    labels: NDArray[np.int32],
    count: int,
    observation: Observation,
    camera: CameraModel,
    body: BodyModel,
    pose: FloatArray,
    margin_px: int,
) -> NDArray[np.bool_]:
    """(count,) which components come near to the body; the first is the background's."""
    near = _thick_body(observation, camera, body, pose, margin_px)
    kept = np.zeros(count, dtype=np.bool_)
    kept[np.unique(labels[near])] = True
    kept[0] = False
    return kept


def _only(
    observation: Observation, labels: NDArray[np.int32], kept: NDArray[np.bool_]
) -> tuple[Observation, int]:
    if kept[1:].all():
        return observation, 0
    selected = kept[labels]
    mask = observation.mask
    # A shadow away from the body remains one: it is no lit floor.
    part = observation.with_masks(mask & selected, observation.undecided)
    return part, int((mask & ~selected).sum())


def _thick_body(
    observation: Observation, camera: CameraModel, body: BodyModel, pose: FloatArray, margin_px: int
) -> NDArray[np.bool_]:
    """Mask (h, w) of the region's pixels within a margin of the body."""
    out = np.zeros((observation.height, observation.width), dtype=np.uint8)
    focal = float(camera.matrix[0, 0])
    lines, depths_m, radii_m = _cone_lines(camera, body, pose)
    for line, depth_m, radius_m in zip(lines, depths_m, radii_m, strict=True):
        pixels = line - observation.offset_px
        if not np.isfinite(pixels).all() or np.abs(pixels).max() > 1e4:
            continue
        thickness = max(1, min(2 * (round(focal * radius_m / depth_m) + margin_px), 255))
        points = np.round(pixels).astype(np.int32).reshape(-1, 1, 2)
        cv2.polylines(out, [points], False, 1, thickness)
    return out.view(np.bool_)


def _cone_lines(
    camera: CameraModel, body: BodyModel, pose: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Per cone: points (c, n, 2) px along its axis, their least depth and its largest radius, m."""
    t = np.linspace(0.0, 1.0, _POINTS_PER_CONE)
    placed = cone_transforms(body, pose)
    ends, shape = body.cone_shape[:, :, 2:], body.cone_shape
    local = np.empty((len(placed), t.size, 3))
    local[:, :, :2] = (1.0 - t)[:, None] * ends[:, None, 0] + t[:, None] * ends[:, None, 1]
    local[:, :, 2] = t * body.cone_length[:, None]
    points = local @ placed[:, :3, :3].transpose(0, 2, 1) + placed[:, None, :3, 3]
    depths_m = points @ camera.T_cam_world[2, :3] + camera.T_cam_world[2, 3]
    pixels = project_camera(points.reshape(-1, 3), camera).reshape(*points.shape[:2], 2)
    return pixels, depths_m.min(axis=1), shape[:, :, :2].max(axis=(1, 2))
