"""Which parts of a silhouette are the tracked body's: the components that the prediction meets."""

import cv2
import numpy as np
from numpy.typing import NDArray

from markerless_tracker.body import BodyModel, cone_transforms
from markerless_tracker.camera import CameraModel, project_camera
from markerless_tracker.geometry import FloatArray
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
    mask = observation.mask.view(np.uint8)
    count, labels = cv2.connectedComponents(mask, connectivity=8, ltype=cv2.CV_32S)
    if count <= 2:
        return observation, 0
    near = _thick_body(observation, camera, body, pose, margin_px)
    kept = np.zeros(count, dtype=np.bool_)
    kept[np.unique(labels[near])] = True
    kept[0] = False
    if not kept.any() or kept[1:].all():
        return observation, 0
    selected = kept[labels]
    left_out = int(mask.sum()) - int(selected.sum())
    return (
        Observation.from_mask(
            observation.camera,
            observation.stamp_ns,
            selected,
            observation.edges,
            size_px=observation.size_px,
            offset_px=observation.offset_px,
        ),
        left_out,
    )


def _thick_body(
    observation: Observation, camera: CameraModel, body: BodyModel, pose: FloatArray, margin_px: int
) -> NDArray[np.bool_]:
    """Mask (h, w) of the region's pixels within a margin of the body."""
    out = np.zeros((observation.height, observation.width), dtype=np.uint8)
    focal = float(camera.matrix[0, 0])
    t = np.linspace(0.0, 1.0, _POINTS_PER_CONE)
    placed = cone_transforms(body, pose)
    for place, length, shape in zip(placed, body.cone_length, body.cone_shape, strict=True):
        centre = (1.0 - t)[:, None] * shape[0, 2:] + t[:, None] * shape[1, 2:]
        points = np.column_stack([centre, t * length]) @ place[:, :3].T + place[:, 3]
        depth = points @ camera.T_cam_world[2, :3] + camera.T_cam_world[2, 3]
        pixels = project_camera(points, camera) - observation.offset_px
        if not np.isfinite(pixels).all() or np.abs(pixels).max() > 1e4:
            continue
        radius = focal * float(shape[:, :2].max()) / float(depth.min())
        thickness = max(1, min(2 * (round(radius) + margin_px), 255))
        line = np.round(pixels).astype(np.int32).reshape(-1, 1, 2)
        cv2.polylines(out, [line], False, 1, thickness)
    return out.view(np.bool_)
