"""Outline polygons and silhouette of a body in an image; slow and exact."""

import cv2
import numpy as np
from numpy.typing import NDArray

from markerless_tracker.body import BodyModel, cone_transforms
from markerless_tracker.camera import CameraModel, project_camera
from markerless_tracker.geometry import FloatArray

END_POINTS = 72
"""Number of points on the ellipse of an end."""
SIDE_SECTIONS = 9
"""Sections between the ends, needed where lens distortion curves the sides."""

_SHIFT = 8
"""Fractional bits of OpenCV's fixed-point coordinates."""


def cone_surfaces(
    body: BodyModel, *, end_points: int = END_POINTS, sections: int = SIDE_SECTIONS
) -> FloatArray:
    """(c, k, 3) points on each cone in its base frame, m.

    Args:
        body: the body.
        end_points: points on the ellipse of an end.
        sections: sections between the ends.
    """
    return np.array(
        [
            _surface(float(length), shape, end_points, sections)
            for length, shape in zip(body.cone_length, body.cone_shape, strict=True)
        ]
    )


def outlines(
    body: BodyModel,
    pose: FloatArray,
    camera: CameraModel,
    *,
    surfaces: FloatArray | None = None,
) -> list[FloatArray]:
    """Outline (n, 2) in px of each cone at a pose (p,), through the lens.

    The convex hull of the projected cone; empty (0, 2) if a part of it is behind the camera.
    `surfaces` are the body's `cone_surfaces`, None = computed here.
    """
    local = cone_surfaces(body) if surfaces is None else surfaces
    T = cone_transforms(body, pose)
    points = local @ T[:, :, :3].transpose(0, 2, 1) + T[:, None, :, 3]
    projected = project_camera(points.reshape(-1, 3), camera).reshape(*points.shape[:2], 2)
    result = []
    for pixels in projected:
        if not np.isfinite(pixels).all():
            result.append(np.empty((0, 2)))
            continue
        hull = cv2.convexHull(pixels.astype(np.float32))[:, 0]
        result.append(hull.astype(np.float64))
    return result


def silhouette(
    body: BodyModel,
    pose: FloatArray,
    camera: CameraModel,
    *,
    samples: int = 1,
    cones: NDArray[np.bool_] | None = None,
) -> NDArray[np.bool_]:
    """Mask (h, w) of the pixels that the body covers at a pose (p,).

    Args:
        body: the body.
        pose: (p,) pose.
        camera: the camera.
        samples: 1: a pixel belongs to the mask if its centre lies inside an outline; more: if at
            least half of its samples x samples points do.
        cones: (c,) mask of the cones to draw, None = all.
    """
    width, height = camera.size_px
    columns, rows = np.meshgrid(np.arange(width * samples), np.arange(height * samples))
    u, v = (columns + 0.5) / samples - 0.5, (rows + 0.5) / samples - 0.5
    covered = np.zeros(u.shape, dtype=np.bool_)
    for i, polygon in enumerate(outlines(body, pose, camera)):
        if len(polygon) < 3 or (cones is not None and not cones[i]):
            continue
        low, high = polygon.min(axis=0), polygon.max(axis=0)
        first = np.clip(np.floor((low + 0.5) * samples - 0.5), 0, covered.shape[::-1]).astype(int)
        last = np.clip(np.ceil((high + 0.5) * samples + 0.5), 0, covered.shape[::-1]).astype(int)
        region = np.s_[first[1] : last[1], first[0] : last[0]]
        inside = np.ones(u[region].shape, dtype=np.bool_)
        # Intersection of half-planes; hulls can be clockwise or counter-clockwise.
        orientation = np.sign(_area(polygon))
        for a, b in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
            cross = (b[0] - a[0]) * (v[region] - a[1]) - (b[1] - a[1]) * (u[region] - a[0])
            inside &= orientation * cross >= 0.0
        covered[region] |= inside
    fraction = covered.reshape(height, samples, width, samples).mean(axis=(1, 3))
    return np.asarray(fraction >= 0.5)


def fixed_point(points_px: FloatArray) -> tuple[NDArray[np.int32], int]:
    """Points (n, 2) in OpenCV's fixed-point coordinates, and their fractional bits."""
    limited = np.clip(points_px, -4.0e6, 4.0e6)
    return np.rint(limited * (1 << _SHIFT)).astype(np.int32), _SHIFT


def _surface(length: float, shape: FloatArray, end_points: int, sections: int) -> FloatArray:
    """Points (n, 3) on a cone in its base frame.

    The point of an end's ellipse with normal n is r² n / |r n|. Points of both ends with the same
    normal are joined by a line of the side.
    """
    angle = 2.0 * np.pi * np.arange(end_points) / end_points
    # Normals at evenly spaced points of the mean section: equal angles undersample flat sides.
    normal = np.column_stack([np.cos(angle), np.sin(angle)]) / shape[:, :2].mean(axis=0)
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    start, end = (
        row[2:] + row[:2] ** 2 * normal / np.linalg.norm(row[:2] * normal, axis=1)[:, None]
        for row in shape
    )
    return np.concatenate(
        [
            np.column_stack([(1.0 - t) * start + t * end, np.full(end_points, t * length)])
            for t in np.linspace(0.0, 1.0, sections + 2)
        ]
    )


def _area(polygon: FloatArray) -> float:
    x, y = polygon.T
    return float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))
