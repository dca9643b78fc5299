"""Small grey images, in which scenes are compared."""

import cv2
import numpy as np
from numpy.typing import NDArray

from markerless_tracker.imaging import Image
from markerless_tracker.imaging.images import grey_of

WIDTH_PX = 320
"""Largest width of a small image."""


def small_grey(image: Image) -> NDArray[np.uint8]:
    """An image (h, w, 3) BGR or (h, w) grey, reduced to at most `WIDTH_PX`, grey."""
    grey = grey_of(image)
    factor = min(1.0, WIDTH_PX / grey.shape[1])
    size = (max(8, round(grey.shape[1] * factor)), max(8, round(grey.shape[0] * factor)))
    return np.asarray(cv2.resize(grey, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)
