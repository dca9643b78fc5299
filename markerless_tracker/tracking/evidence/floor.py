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

from markerless_tracker.camera import CameraModel, project_camera
from markerless_tracker.geometry import FloatArray

Mask = NDArray[np.bool_]


class FloorView(NamedTuple):
    """What a camera shows of the floor, in a window of its frame.

    Attributes:
        camera: its model.
        offset_px: (u, v) of the window's top left pixel.
        undecided: (h, w) pixels that look like a shadow.
        lit: (h, w) pixels that are certainly background in full light.
        hidden: (h, w) pixels of the predicted body: they show no floor.
    """

    camera: CameraModel
    offset_px: tuple[int, int]
    undecided: Mask
    lit: Mask
    hidden: Mask


def floor_points(pixels: FloatArray, camera: CameraModel) -> FloatArray:
    """Points (n, 3) m where the rays of pixels (n, 2) meet the floor; NaN where they do not."""
    points = np.ascontiguousarray(pixels, dtype=np.float64).reshape(-1, 1, 2)
    if len(points) == 0:
        # OpenCV returns None for no points.
        return np.empty((0, 3))
    rays = cv2.undistortPoints(points, camera.matrix, camera.distortion).reshape(-1, 2)
    placed = camera.T_world_cam
    directions = np.column_stack([rays, np.ones(len(rays))]) @ placed[:3, :3].T
    centre = placed[:3, 3]
    with np.errstate(divide="ignore", invalid="ignore"):
        along = np.where(directions[:, 2] * centre[2] < 0.0, -centre[2] / directions[:, 2], np.nan)
    return np.asarray(centre + along[:, None] * directions)


def lit_elsewhere(points: FloatArray, others: Iterable[FloorView]) -> Mask:
    """Which floor points (n, 3) m some camera sees lit and none darkened; never those with NaN."""
    lit, dark = np.zeros((2, len(points)), dtype=np.bool_)
    for view in others:
        with np.errstate(invalid="ignore"):
            pixels = np.round(project_camera(points, view.camera)) - view.offset_px
            height, width = view.lit.shape
            inside = (pixels >= 0.0).all(axis=1) & (pixels < (width, height)).all(axis=1)
        seen = np.flatnonzero(inside)
        u, v = pixels[seen].astype(np.int64).T
        clear = ~view.hidden[v, u]
        lit[seen] |= clear & view.lit[v, u]
        dark[seen] |= clear & view.undecided[v, u]
    return lit & ~dark
