"""The channels of a part of an image, each in its own memory.

OpenCV's `split` takes ten times as long for a part whose rows are not adjacent.
"""

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.compiled import kernel
from markerless_tracker.imaging.images import Image
from markerless_tracker.imaging.prefetch import ROWS_AHEAD, prefetch
from markerless_tracker.imaging.region import Region
from markerless_tracker.observation import locked


# One loop over one row, which the compiler vectorises.
@kernel
def _split_row(pixels, first, second, third):  # type: ignore[no-untyped-def]
    for j in range(first.size):
        first[j] = pixels[3 * j]
        second[j] = pixels[3 * j + 1]
        third[j] = pixels[3 * j + 2]


@kernel
def _split(rows, left, top, planes):  # type: ignore[no-untyped-def]
    """See `split_channels`; rows (h, 3 w)."""
    begin, end = 3 * left, 3 * (left + planes.shape[2])
    for i in range(planes.shape[1]):
        if i + ROWS_AHEAD < planes.shape[1]:
            prefetch(rows[top + i + ROWS_AHEAD, begin:end])
        _split_row(rows[top + i, begin:end], planes[0, i], planes[1, i], planes[2, i])


def split_channels(image: Image, part: Region, planes: NDArray[np.uint8]) -> None:
    """Fill planes (3, a, b) with the channels of a part of an image (h, w, 3)."""
    _split(locked(image, np.uint8).reshape(image.shape[0], -1), part.left, part.top, planes)
