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


# Sums of one row each. Sums of the channels and the number of pixels share one integer: no sum over
# a window exceeds 16 bits.
_FIELD = 16
_COUNT = np.int64(1) << np.int64(3 * _FIELD)


@kernel
def _slide(image, source, entering, old, total):  # type: ignore[no-untyped-def]
    """Replace the row ``old`` in the column sums ``total`` by a row of the image.

    Args:
        image: (b, c) uint8, the row; pixels outside of ``source`` are left out.
        source: (b,) uint8, 0 or 255.
        entering: whether there is such a row; if not, the sums get nothing.
        old: (b,) int64, the row that leaves; becomes the one that enters.
        total: (b,) int64, fields of `_FIELD` bits: the sums of up to three channels, and the number
            of pixels at the fourth.
    """
    if not entering:
        for j in range(total.size):
            total[j] -= old[j]
            old[j] = 0
        return
    # Without a loop over the channels the compiler can vectorise this one. The last two channels
    # count nothing if there is one alone.
    last = image.shape[1] - 1
    second, third = np.int64(last > 0) << _FIELD, np.int64(last > 0) << (2 * _FIELD)
    for j in range(total.size):
        new = _COUNT + np.int64(image[j, 0])
        new += second * np.int64(image[j, last // 2]) + third * np.int64(image[j, last])
        new = new if source[j] != 0 else np.int64(0)
        total[j] += new - old[j]
        old[j] = new


@kernel
def _sum_near(image, source, top, bottom, left, right):  # type: ignore[no-untyped-def]
    """The pixels of a window that are in ``source``, summed as by `_slide`."""
    total = np.int64(0)
    for y in range(top, bottom):
        for x in range(left, right):
            if source[y, x] != 0:
                total += _COUNT
                for c in range(image.shape[2]):
                    total += np.int64(image[y, x, c]) << np.int64(c * _FIELD)
    return total


@kernel
def mark_half_covered(image, mean, gain, left, top, mask, inner, deep, least, scratch, cleared):  # type: ignore[no-untyped-def]
    """Mark pixels of the mask's border that the body covers by less than half.

    Args:
        image: (a, b, c) uint8, a part of an image.
        mean: (c, h, w) uint16, the background, in steps of 1 / `LEVELS` grey level.
        gain: (c,) float32, brightness of the image relative to the background's.
        left, top: the part's first column and row in the image.
        mask: (a, b) uint8, 0 or 255.
        inner, deep: (a, b) the mask without its border, and without two layers.
        least: least squared difference of body and background for which a pixel is decided.
        scratch: (2 `_NEAR_PX` + 2, b) int64, 0; overwritten.
        cleared: (a, b) uint8, 255 at pixels to clear; written.
    """
    rows, columns = mask.shape
    channels = image.shape[2]
    white, level = np.float32(255.0), np.float32(1.0 / LEVELS)
    side = 2 * _NEAR_PX + 1
    field = np.int64((1 << _FIELD) - 1)
    total = scratch[side]
    for y in range(rows + _NEAR_PX):
        v = min(y, rows - 1)
        _slide(image[v], deep[v], y < rows, scratch[y % side], total)
        i = y - _NEAR_PX
        if i < 0:
            continue
        for j in range(columns):
            cleared[i, j] = 0
            # The border is the difference, since ``inner`` lies within the mask.
            if mask[i, j] == inner[i, j]:
                continue
            begin, end = max(j - _NEAR_PX, 0), min(j + _NEAR_PX + 1, columns)
            near = np.int64(0)
            for x in range(begin, end):
                near += total[x]
            if near == 0:
                first, last = max(i - _NEAR_PX, 0), min(i + _NEAR_PX + 1, rows)
                near = _sum_near(image, inner, first, last, begin, end)
            if near == 0:
                continue
            count = np.float32(near >> np.int64(3 * _FIELD))
            along = np.float32(0.0)
            length = np.float32(0.0)
            for c in range(channels):
                body = np.float32((near >> np.int64(c * _FIELD)) & field) / count
                base = min(gain[c] * level * np.float32(mean[c, top + i, left + j]), white)
                contrast = body - base
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
    cleared = np.empty_like(mask)
    for _ in range(layers):
        scratch = np.zeros((2 * _NEAR_PX + 2, mask.shape[1]), dtype=np.int64)
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
            scratch,
            cleared,
        )
        cv2.subtract(mask, cleared, dst=mask)
