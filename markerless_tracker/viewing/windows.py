"""The part of each camera's image in which the person moves."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from markerless_tracker.camera import CameraModel, CameraRig, project_camera
from markerless_tracker.drawing.overlay import Image
from markerless_tracker.results.stored_result import StoredResult

MARGIN = 0.12
"""Margin around the markers, relative to the height of the window."""
WHOLE = 0.85
"""Windows wider than this, relative to the image's width, become the whole image."""
LEAST = 0.15
"""Least width of a window, relative to the image's."""

_MOST_ROWS = 500


@dataclass(frozen=True)
class Window:
    """A part of an image with the image's aspect ratio, as fractions of its width and height.

    Attributes:
        left, top: its corner.
        size: its width and height.
    """

    left: float = 0.0
    top: float = 0.0
    size: float = 1.0

    def of(self, image: Image) -> Image:
        """That part of an image (h, w, ...), without a copy."""
        height, width = image.shape[:2]
        u, v = round(self.left * width), round(self.top * height)
        w, h = max(1, round(self.size * width)), max(1, round(self.size * height))
        return image[v : v + h, u : u + w]


def windows(result: StoredResult, rig: CameraRig) -> Mapping[str, Window]:
    """Camera -> the smallest window that holds the markers, with a margin.

    The markers are those of at least 500 evenly spaced frames, or of all in a shorter result.
    The whole image of a camera that never has the markers in view.
    """
    step = max(1, len(result) // _MOST_ROWS)
    points = result.positions_m[::step].reshape(-1, 3)
    points = points[np.isfinite(points).all(axis=1)]
    return {camera.name: _window(camera, project_camera(points, camera)) for camera in rig}


def _window(camera: CameraModel, pixels: np.ndarray) -> Window:
    size = np.array(camera.size_px, dtype=np.float64)
    seen = (pixels / size)[np.isfinite(pixels).all(axis=1)]
    seen = np.clip(seen, 0.0, 1.0)[((seen >= 0.0) & (seen <= 1.0)).all(axis=1)]
    if not seen.size:
        return Window()
    low, high = seen.min(axis=0), seen.max(axis=0)
    width = max(float((high - low).max()) * (1.0 + 2.0 * MARGIN), LEAST)
    if width >= WHOLE:
        return Window()
    left, top = np.clip(0.5 * (low + high) - 0.5 * width, 0.0, 1.0 - width).tolist()
    return Window(left, top, width)
