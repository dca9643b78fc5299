"""Trimming of the silhouette's border: pixels that the body covers by less than half are cleared.

The foreground test passes for any difference from the background, hence also for border pixels that
the body covers only partly, and the silhouette is half a pixel too wide. Such a pixel is a mixture,
I = a F + (1 - a) B, of its background B and the colour F of the body beside it; a is the covered
fraction.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from markerless_tracker.compiled import kernel
from markerless_tracker.imaging.images import Image
from markerless_tracker.imaging.masks import SOLID
from markerless_tracker.imaging.region import Region
from markerless_tracker.imaging.segmentation.kernels import LEVELS

# Radius of the window from which the colour of the body beside a pixel is taken, px.
_NEAR_PX = 3


@kernel
def _sum_near(image, source, top, bottom, left, right, sums):  # type: ignore[no-untyped-def]
    """Number of the pixels of a window that are in ``source``, and their sums by channel."""
    count = 0
    sums[:] = 0
    for y in range(top, bottom):
        for x in range(left, right):
            if source[y, x] != 0:
                count += 1
                for c in range(sums.size):
                    sums[c] += image[y, x, c]
    return count


@kernel
def mark_half_covered(image, mean, gain, left, top, mask, inner, deep, least, sums, cleared):  # type: ignore[no-untyped-def]
    """Mark pixels of the mask's border that the body covers by less than half.

    Args:
        image: (a, b, c) uint8, a part of an image.
        mean: (c, h, w) uint16, the background, in steps of 1 / `LEVELS` grey level.
        gain: (c,) float32, brightness of the image relative to the background's.
        left, top: the part's first column and row in the image.
        mask: (a, b) uint8, 0 or 255.
        inner, deep: (a, b) the mask without its border, and without two layers.
        least: least squared difference of body and background for which a pixel is decided.
        sums: (c,) int32, scratch.
        cleared: (a, b) uint8, 255 at pixels to clear; written.
    """
    rows, columns = mask.shape
    channels = image.shape[2]
    white, level = np.float32(255.0), np.float32(1.0 / LEVELS)
    for i in range(rows):
        first, last = max(i - _NEAR_PX, 0), min(i + _NEAR_PX + 1, rows)
        for j in range(columns):
            cleared[i, j] = 0
            if mask[i, j] == 0 or inner[i, j] != 0:
                continue
            begin, end = max(j - _NEAR_PX, 0), min(j + _NEAR_PX + 1, columns)
            count = _sum_near(image, deep, first, last, begin, end, sums)
            if count == 0:
                count = _sum_near(image, inner, first, last, begin, end, sums)
            if count == 0:
                continue
            along = np.float32(0.0)
            length = np.float32(0.0)
            for c in range(channels):
                base = min(gain[c] * level * np.float32(mean[c, top + i, left + j]), white)
                contrast = np.float32(sums[c]) / np.float32(count) - base
                along += (np.float32(image[i, j, c]) - base) * contrast
                length += contrast * contrast
            if length >= least and along < np.float32(0.5) * length:
                cleared[i, j] = 255


def border_radius_px(layers: int) -> int:
    """Radius of the neighbourhood that a pixel's result of `trim_border` depends on, px."""
    return layers * (_NEAR_PX + 2)


def trim_border(
    image: Image,
    mean: NDArray[np.uint16],
    gain: NDArray[np.float32],
    mask: NDArray[np.uint8],
    part: Region,
    *,
    layers: int,
    least: float,
) -> None:
    """Clear pixels of a mask's border that the body covers by less than half, in place.

    Args:
        image: (a, b, c) uint8, a part of an image.
        mean: (c, h, w) the background of the whole image, in steps of 1 / `LEVELS` grey level.
        gain: (c,) brightness of the image relative to the background's.
        mask: (a, b) uint8, 0 or 255, of the part.
        part: its place in the image.
        layers: largest number of border layers to clear, one after the other.
        least: least difference of body and background for which a pixel is decided, grey levels.
    """
    cleared, sums = np.empty_like(mask), np.empty(image.shape[2], dtype=np.int32)
    for _ in range(layers):
        inner = cv2.erode(mask, SOLID)
        deep = cv2.erode(inner, SOLID)
        mark_half_covered(
            image,
            mean,
            gain,
            part.left,
            part.top,
            mask,
            inner,
            deep,
            np.float32(least**2),
            sums,
            cleared,
        )
        cv2.subtract(mask, cleared, dst=mask)
