"""Points of a grid in the room, and what the views show of them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from markerless_tracker.camera import CameraModel
from markerless_tracker.camera.lens import pixel
from markerless_tracker.compiled import kernel
from markerless_tracker.geometry import FloatArray
from markerless_tracker.records import Observation

COARSE_M = 0.20
"""Spacing of the room's grid."""
FINE_M = 0.03
"""Spacing of the grid around a person."""
LEAST_VIEWS = 2
"""Cameras that must have a point in view for it to count."""
SHADOW_HEIGHT_M = 0.08
"""Below this height above the floor, z = 0, undecided pixels are taken for shadows."""
_BACKGROUND, _PERSON = 0, 2


@dataclass(frozen=True, eq=False)
class GridViews:
    """Cameras and their silhouettes, dilated to bridge a grid's spacing.

    Attributes:
        masks: by spacing of the grid, (v, h, w), each view in the top left corner: 0 background,
            1 undecided, 2 person.
        size_px: (v, 2) width and height of each view.
        to_camera: (v, 4, 4) world to camera.
        matrix: (v, 3, 3) intrinsics.
        distortion: (v, 5).
    """

    masks: Mapping[float, NDArray[np.uint8]]
    size_px: NDArray[np.int64]
    to_camera: FloatArray
    matrix: FloatArray
    distortion: FloatArray

    @classmethod
    def of(cls, seen: Sequence[tuple[CameraModel, Observation]], middle: FloatArray) -> "GridViews":
        """Views, silhouettes dilated by half a grid spacing at the scene's middle."""
        cameras = [camera for camera, _ in seen]
        size_px = np.array([camera.size_px for camera in cameras])
        width, height = size_px.max(axis=0)
        masks = {
            spacing: np.zeros((len(seen), height, width), dtype=np.uint8)
            for spacing in (COARSE_M, FINE_M)
        }
        for number, (camera, observation) in enumerate(seen):
            either = observation.not_background.view(np.uint8) + observation.mask.view(np.uint8)
            mask = observation.in_full_frame(either)
            depth = float(camera.T_cam_world[2, :3] @ middle + camera.T_cam_world[2, 3])
            scale = float(camera.matrix[0, 0]) / max(depth, 1.0)
            for spacing, out in masks.items():
                _grow(mask, round(0.5 * spacing * scale), out[number])
        return cls(
            masks,
            size_px,
            np.array([camera.T_cam_world for camera in cameras]),
            np.array([camera.matrix for camera in cameras]),
            np.array([camera.distortion for camera in cameras]),
        )


def _grow(mask: NDArray[np.uint8], radius: int, out: NDArray[np.uint8]) -> None:
    """Fill zeros `out` with a mask (h, w), dilated by an ellipse.

    Only the part of the mask that is not 0 costs time.
    """
    u, v, width, height = cv2.boundingRect(mask)
    rows = slice(max(v - radius, 0), min(v + height + radius, len(mask)))
    columns = slice(max(u - radius, 0), min(u + width + radius, mask.shape[1]))
    side = 2 * radius + 1
    ellipse = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side))
    out[rows, columns] = cv2.dilate(mask[rows, columns], ellipse)


def occupied(
    low: FloatArray,
    size: NDArray[np.int64],
    spacing: float,
    views: GridViews,
    cells: NDArray[np.bool_] | None = None,
) -> tuple[NDArray[np.bool_], NDArray[np.int8], NDArray[np.bool_]]:
    """Finds the points of a grid that belong to the hull.

    Args:
        low: (3,) corner of the grid, m.
        size: (3,) its number of points along each axis.
        spacing: m.
        views: the silhouettes.
        cells: cells of the coarse grid with the same corner; points outside of them are left out.

    Returns:
        Per point: whether it belongs to the hull, and if it does, how many views have it in their
        frame, and whether at least two views see it as person; 0 and False elsewhere.
    """
    if cells is None:
        cells, ratio = np.ones((1, 1, 1), dtype=np.bool_), 0.0
    else:
        ratio = spacing / COARSE_M
    cell_of = tuple(
        np.minimum((ratio * (np.arange(n) + 0.5)).astype(np.int64), m - 1)
        for n, m in zip(size, cells.shape, strict=True)
    )
    inside, person = np.zeros((2, *size), dtype=np.bool_)
    view_count = np.zeros(size, dtype=np.int8)
    _carve(
        low, spacing, cell_of, cells, views.masks[spacing], views.size_px, views.to_camera,
        views.matrix, views.distortion, inside, view_count, person,
    )  # fmt: skip
    return inside, view_count, person


@kernel
def _carve(  # type: ignore[no-untyped-def]
    low, spacing, cell_of, cells, masks, size_px, to_camera, matrix, distortion, inside,
    view_count, person,
):  # fmt: skip
    """Fill `inside`, `view_count` and `person` (i, j, k), zero before, as `occupied` returns them.

    Args:
        low, spacing: as of `occupied`.
        cell_of: for each axis, the cell of each point.
        cells: whether a cell counts.
        masks, size_px, to_camera, matrix, distortion: as of `GridViews`.
    """
    for i in range(inside.shape[0]):
        for j in range(inside.shape[1]):
            for k in range(inside.shape[2]):
                if not cells[cell_of[0][i], cell_of[1][j], cell_of[2][k]]:
                    continue
                x = low[0] + spacing * (i + 0.5)
                y = low[1] + spacing * (j + 0.5)
                z = low[2] + spacing * (k + 0.5)
                framed, persons = 0, 0
                for view in range(masks.shape[0]):
                    u, v = pixel(x, y, z, to_camera[view], matrix[view], distortion[view])
                    # NaN fails the comparison: behind the camera.
                    if not (
                        u >= 0.0 and v >= 0.0 and u < size_px[view, 0] and v < size_px[view, 1]
                    ):
                        continue
                    shown = masks[view, np.int64(v), np.int64(u)]
                    if shown == _BACKGROUND:
                        framed = 0
                        break
                    framed += 1
                    persons += shown == _PERSON
                if framed >= LEAST_VIEWS and (persons >= LEAST_VIEWS or z > SHADOW_HEIGHT_M):
                    inside[i, j, k] = True
                    view_count[i, j, k] = framed
                    person[i, j, k] = persons >= LEAST_VIEWS
