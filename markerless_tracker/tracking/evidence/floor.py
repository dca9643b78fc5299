"""The floor test: an undecided pixel whose floor point other cameras see lit is no shadow.

A shadow lies on the floor, the plane z = 0 of the calibrated world: the floor point behind such a
pixel is darkened alike in every camera that sees it. The floor point behind a pixel of the person
is another one for each camera, and mostly lit.
"""

from collections.abc import Iterable
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from markerless_tracker.camera import CameraModel
from markerless_tracker.camera.lens import pixel
from markerless_tracker.compiled import kernel
from markerless_tracker.fitness.raster.mask_words import has
from markerless_tracker.geometry import FloatArray
from markerless_tracker.records import MaskWords

PENUMBRA_PX = 2
"""Background so near to what is not background may be half in shadow, and is not called lit."""


class FloorView(NamedTuple):
    """What a camera shows of the floor, in a window of its frame.

    Attributes:
        camera: its model.
        offset_px: (u, v) of the window's top left pixel.
        width: of the window, px.
        person: (h, ceil(w / 64)) silhouette, packed as `pack_mask` does.
        undecided: pixels that look like a shadow, packed likewise.
        hidden: pixels of the predicted body, packed likewise: they show no floor.
    """

    camera: CameraModel
    offset_px: tuple[int, int]
    width: int
    person: MaskWords
    undecided: MaskWords
    hidden: MaskWords


def floor_points(pixels: FloatArray, camera: CameraModel) -> FloatArray:
    """Points (n, 3) m where the rays of pixels (n, 2) meet the floor; NaN where they do not."""
    points = np.ascontiguousarray(pixels, dtype=np.float64).reshape(-1, 1, 2)
    if points.size == 0:
        # OpenCV returns None.
        return np.empty((0, 3))
    rays = cv2.undistortPoints(points, camera.matrix, camera.distortion).reshape(-1, 2)
    placed = camera.T_world_cam
    directions = np.column_stack([rays, np.ones(len(rays))]) @ placed[:3, :3].T
    centre = placed[:3, 3]
    with np.errstate(divide="ignore", invalid="ignore"):
        along = np.where(directions[:, 2] * centre[2] < 0.0, -centre[2] / directions[:, 2], np.nan)
    return np.asarray(centre + along[:, None] * directions)


def lit_elsewhere(points: FloatArray, others: Iterable[FloorView]) -> NDArray[np.bool_]:
    """Which floor points (n, 3) m some camera sees lit and none darkened; never those with NaN.

    Lit are pixels that are neither person nor undecided, nor within `PENUMBRA_PX` of such.
    """
    lit, dark = np.zeros((2, len(points)), dtype=np.bool_)
    for view in others:
        camera = view.camera
        _look(
            points, camera.T_cam_world, camera.matrix, camera.distortion, view.offset_px,
            view.width, view.person, view.undecided, view.hidden, lit, dark,
        )  # fmt: skip
    return lit & ~dark


@kernel
def _look(  # type: ignore[no-untyped-def]
    points, to_camera, matrix, distortion, offset, width, person, undecided, hidden, lit, dark
):
    """Mark the points (n, 3) that a view shows lit, and those that it shows darkened."""
    height = person.shape[0]
    for i in range(points.shape[0]):
        u, v = pixel(points[i, 0], points[i, 1], points[i, 2], to_camera, matrix, distortion)
        u, v = u - offset[0], v - offset[1]
        # Not for NaN either.
        if not (u >= 0.0 and v >= 0.0 and u < width and v < height):
            continue
        column, row = np.int64(u), np.int64(v)
        if has(hidden, column, row):
            continue
        if has(undecided, column, row):
            dark[i] = True
        elif not _near_any(person, undecided, column, row, width):
            lit[i] = True


@kernel
def _near_any(person, undecided, u, v, width):  # type: ignore[no-untyped-def]
    """Whether a pixel within `PENUMBRA_PX` is person or undecided."""
    for row in range(max(0, v - PENUMBRA_PX), min(person.shape[0], v + PENUMBRA_PX + 1)):
        for column in range(max(0, u - PENUMBRA_PX), min(width, u + PENUMBRA_PX + 1)):
            if has(person, column, row) or has(undecided, column, row):
                return True
    return False
