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
from markerless_tracker.imaging.masks import SOLID
from markerless_tracker.imaging.region import Region
from markerless_tracker.imaging.segmentation.kernels import LEVELS

# Radius of the window from which the colour of the body beside a pixel is taken, px.
_NEAR_PX = 3
# Two sums share an integer: no sum over a window exceeds 16 bits.
_FIELD = 16
_ONE = np.uint32(1) << np.uint32(_FIELD)
_LOW = np.uint32((1 << _FIELD) - 1)


# Loops over one row with few arrays each, which the compiler vectorises.
@kernel
def _replace_row(low, high, source, old, total):  # type: ignore[no-untyped-def]
    """Replace the row ``old`` in the column sums ``total`` by low + high 2^16.

    Args:
        low, high: (b,) uint8, the row; pixels outside of ``source`` count nothing.
        source: (b,) uint8, 0 or 255.
        old, total: (b,) uint32; old becomes the new row.
    """
    for j in range(total.size):
        new = np.uint32(low[j]) + _ONE * np.uint32(high[j])
        new = new if source[j] != 0 else np.uint32(0)
        total[j] += new - old[j]
        old[j] = new


@kernel
def _mark_border(mask, inner, marks):  # type: ignore[no-untyped-def]
    """Mark the pixels of a row of the mask that are not in ``inner``, which lies within it."""
    for j in range(mask.size):
        marks[j] = mask[j] ^ inner[j]


@kernel
def _sum_near(planes, source, top, bottom, left, right, x, y):  # type: ignore[no-untyped-def]
    """Sums of a window's pixels in ``source``: first and second channel, third channel and count.

    x, y: where ``source`` begins in the planes.
    """
    last = planes.shape[0] - 1
    two, third = np.uint32(0), np.uint32(0)
    for i in range(top, bottom):
        for j in range(left, right):
            if source[i, j] != 0:
                two += np.uint32(planes[0, y + i, x + j])
                two += _ONE * np.uint32(planes[last // 2, y + i, x + j])
                third += np.uint32(planes[last, y + i, x + j]) + _ONE
    return two, third


@kernel
def mark_half_covered(  # type: ignore[no-untyped-def]
    planes, x, y, mean, gain, left, top, mask, inner, deep, least, rings, row, marks, cleared
):
    """Mark pixels of the mask's border that the body covers by less than half.

    Args:
        planes: (c, d, e) uint8, one or three channels of a part of an image.
        x, y: column and row where the mask begins in it.
        mean: (c, h, w) uint16, the background, in steps of 1 / `LEVELS` grey level.
        gain: (c,) float32, brightness of the image relative to the background's.
        left, top: the mask's first column and row in the image.
        mask: (a, b) uint8, 0 or 255.
        inner, deep: (a, b) the mask without its border, and without two layers.
        least: least squared difference of body and background for which a pixel is decided.
        rings: (2, 2 `_NEAR_PX` + 2, b) uint32, 0; overwritten.
        row: (2, b) uint8, a row of 0 and a row of 1.
        marks: (8 ceil(b / 8),) uint8, 0; overwritten.
        cleared: (a, b) uint8, 255 at pixels to clear; written.
    """
    rows, columns = mask.shape
    last = planes.shape[0] - 1
    white, level = np.float32(255.0), np.float32(1.0 / LEVELS)
    side = 2 * _NEAR_PX + 1
    two, third = rings[0, side], rings[1, side]
    # Groups of eight pixels that are not on the border are skipped at once.
    words = marks.view(np.uint64)
    for below in range(rows + _NEAR_PX):
        # Rows below the mask count nothing.
        v = min(below, rows - 1)
        source = deep[v] if below < rows else row[0]
        blue = planes[0, y + v, x : x + columns]
        green = planes[last // 2, y + v, x : x + columns]
        red = planes[last, y + v, x : x + columns]
        _replace_row(blue, green, source, rings[0, below % side], two)
        _replace_row(red, row[1], source, rings[1, below % side], third)
        i = below - _NEAR_PX
        if i < 0:
            continue
        cleared[i, :] = 0
        _mark_border(mask[i], inner[i], marks)
        for word in range(words.size):
            if words[word] == 0:
                continue
            for j in range(8 * word, min(8 * word + 8, columns)):
                if marks[j] == 0:
                    continue
                begin, end = max(j - _NEAR_PX, 0), min(j + _NEAR_PX + 1, columns)
                near_two, near_third = np.uint32(0), np.uint32(0)
                for u in range(begin, end):
                    near_two += two[u]
                    near_third += third[u]
                if near_third == 0:
                    first, until = max(i - _NEAR_PX, 0), min(i + _NEAR_PX + 1, rows)
                    near_two, near_third = _sum_near(planes, inner, first, until, begin, end, x, y)
                if near_third == 0:
                    continue
                count = np.float32(near_third >> np.uint32(_FIELD))
                along = np.float32(0.0)
                length = np.float32(0.0)
                for c in range(last + 1):
                    near = near_third if c == last else near_two
                    near = near >> np.uint32(_FIELD) if 0 < c < last else near & _LOW
                    body = np.float32(near) / count
                    base = min(gain[c] * level * np.float32(mean[c, top + i, left + j]), white)
                    contrast = body - base
                    along += (np.float32(planes[c, y + i, x + j]) - base) * contrast
                    length += contrast * contrast
                if length >= least and along < np.float32(0.5) * length:
                    cleared[i, j] = 255


def border_radius_px(layers: int) -> int:
    """Radius of the neighbourhood that a pixel's result of `trim_border` depends on, px."""
    return layers * (_NEAR_PX + 2)


def trim_border(
    planes: NDArray[np.uint8],
    corner: tuple[int, int],
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
        planes: (c, d, e) uint8, one or three channels of a part of an image.
        corner: column and row where the mask begins in it.
        mean: (c, h, w) the background of the whole image, in steps of 1 / `LEVELS` grey level.
        gain: (c,) brightness of the image relative to the background's.
        mask: (a, b) uint8, 0 or 255.
        part: its place in the image.
        layers: largest number of border layers to clear, one after the other.
        least: least difference of body and background for which a pixel is decided, grey levels.
    """
    columns = mask.shape[1]
    cleared = np.empty_like(mask)
    marks = np.zeros((columns + 7) // 8 * 8, dtype=np.uint8)
    row = np.zeros((2, columns), dtype=np.uint8)
    row[1] = 1
    for _ in range(layers):
        rings = np.zeros((2, 2 * _NEAR_PX + 2, columns), dtype=np.uint32)
        inner = cv2.erode(mask, SOLID)
        deep = cv2.erode(inner, SOLID)
        mark_half_covered(
            planes, *corner, mean, gain, part.left, part.top, mask, inner, deep,
            np.float32(least**2), rings, row, marks, cleared,
        )  # fmt: skip
        cv2.subtract(mask, cleared, dst=mask)
