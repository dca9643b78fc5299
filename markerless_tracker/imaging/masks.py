"""Masks of an image, and the structuring elements that dilate or erode them."""

import cv2
import numpy as np
from numpy.typing import NDArray

Mask = NDArray[np.uint8]
"""(h, w), 0 or 255."""
SOLID = np.ones((3, 3), dtype=np.uint8)
"""Square structuring element of 3 x 3 pixels."""


def disc(side_px: int) -> Mask:
    """A round structuring element with a given side."""
    shape = cv2.MORPH_ELLIPSE if side_px > 3 else cv2.MORPH_CROSS
    return np.asarray(cv2.getStructuringElement(shape, (side_px, side_px)), dtype=np.uint8)
