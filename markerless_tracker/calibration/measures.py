"""How well a calibration fits: errors per camera and pair, coverage, uncertainty."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations

import cv2
import numpy as np

from markerless_tracker.calibration.bundle import Bundle
from markerless_tracker.camera import CameraModel, project_camera
from markerless_tracker.geometry import FloatArray

GRID = (8, 6)
"""Columns and rows of the cells in which coverage is counted."""


@dataclass(frozen=True)
class CameraMeasures:
    """What is known of one calibrated camera.

    Attributes:
        views: poses of the board it saw.
        corners: corners used.
        outliers: corners left out.
        error_px: root mean square distance of projected and seen corners.
        coverage: fraction of the image's cells that held a corner.
        focal_sd: standard deviation of the focal length, relative to it.
        centre_sd_px: of the principal point.
        position_sd_mm: of the camera's position, relative to the board on the floor.
    """

    views: int
    corners: int
    outliers: int
    error_px: float
    coverage: float
    focal_sd: float
    centre_sd_px: float
    position_sd_mm: float


@dataclass(frozen=True)
class PairMeasures:
    """What two cameras saw together.

    Attributes:
        views: poses of the board that both saw.
        error_px: root mean square distance of seen corners from those triangulated from the two
            images alone and projected back.
    """

    views: int
    error_px: float


def camera_measures(bundle: Bundle) -> dict[str, CameraMeasures]:
    """Measures of every camera."""
    found = {}
    for number, camera in enumerate(bundle.rig):
        mine = bundle.camera == number
        used = mine & bundle.used
        errors = bundle.error_px[used]
        sd = bundle.sd[camera.name]
        cells = cells_seen(bundle.seen_px[mine], camera.size_px)
        found[camera.name] = CameraMeasures(
            views=len(set(bundle.pose[mine])),
            corners=int(used.sum()),
            outliers=int(mine.sum() - used.sum()),
            error_px=float(np.sqrt((errors**2).sum(axis=1).mean())) if len(errors) else np.inf,
            coverage=float((cells > 0).mean()),
            focal_sd=float(max(sd[0] / camera.matrix[0, 0], sd[1] / camera.matrix[1, 1])),
            centre_sd_px=float(max(sd[2], sd[3])),
            position_sd_mm=1000.0 * float(np.linalg.norm(bundle.position_sd_m[camera.name])),
        )
    return found


def pair_measures(bundle: Bundle) -> dict[tuple[str, str], PairMeasures]:
    """Measures of every two cameras that saw the board together."""
    found = {}
    cameras = list(bundle.rig)
    for a, b in combinations(range(len(cameras)), 2):
        seen: list[Mapping[tuple[int, int], int]] = []
        for number in (a, b):
            rows = np.flatnonzero((bundle.camera == number) & bundle.used)
            seen.append({(int(bundle.pose[i]), int(bundle.corner[i])): int(i) for i in rows})
        keys = sorted(set(seen[0]) & set(seen[1]))
        if not keys:
            continue
        pixels = [bundle.seen_px[[one[key] for key in keys]] for one in seen]
        error = _triangulation_error((cameras[a], cameras[b]), pixels)
        pair = cameras[a].name, cameras[b].name
        found[pair] = PairMeasures(len({pose for pose, _ in keys}), error)
    return found


def cells_seen(pixels: FloatArray, size_px: tuple[int, int]) -> FloatArray:
    """Number of corners (rows, columns) in each cell of an image."""
    counts, _, _ = np.histogram2d(
        pixels[:, 1], pixels[:, 0], bins=GRID[::-1],
        range=((-0.5, size_px[1] - 0.5), (-0.5, size_px[0] - 0.5)),
    )  # fmt: skip
    return np.asarray(counts)


def _triangulation_error(
    cameras: tuple[CameraModel, CameraModel], pixels: list[FloatArray]
) -> float:
    flat = [
        cv2.undistortPoints(p.reshape(-1, 1, 2), c.matrix, c.distortion).reshape(-1, 2)
        for c, p in zip(cameras, pixels, strict=True)
    ]
    points = cv2.triangulatePoints(
        cameras[0].T_cam_world[:3], cameras[1].T_cam_world[:3],
        np.ascontiguousarray(flat[0].T), np.ascontiguousarray(flat[1].T),
    )  # fmt: skip
    world = np.asarray(points[:3] / points[3], dtype=np.float64).T
    squares = [
        ((project_camera(world, c) - p) ** 2).sum(axis=1)
        for c, p in zip(cameras, pixels, strict=True)
    ]
    return float(np.sqrt(np.nanmean(np.concatenate(squares))))
