"""Means of patches, which may differ from the background where no single pixel does.

The mean of a patch has less noise than a pixel. So it shows clothes with nearly the background's
colour, and faint shadows.
"""

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.compiled import inlined, kernel
from markerless_tracker.imaging.prefetch import ROWS_AHEAD, prefetch
from markerless_tracker.imaging.segmentation.kernels import LEVELS, WEAK

STEPS = 16
"""Number of steps per grey level in which differences are compared."""


@inlined
def _mirrored(v, count):  # type: ignore[no-untyped-def]
    """Index v of a row beyond the border, mirrored at the border row (OpenCV's REFLECT_101)."""
    if count == 1:
        return 0
    while v < 0 or v >= count:
        v = -v if v < 0 else 2 * count - 2 - v
    return v


# Loops over one row of integers each, which the compiler vectorises. Sums of integers are exact in
# any order, so that the mean of a patch does not depend on the rows summed before.
@kernel
def _take_plain(label, plain, old, total):  # type: ignore[no-untyped-def]
    """Fill ``plain``, 1 at background pixels; it replaces ``old`` in the column sums ``total``."""
    for j in range(label.size):
        # Weak pixels were background before.
        one = np.int32((label[j] == 0) | (label[j] == WEAK))
        total[j] += one - old[j]
        old[j] = one
        plain[j] = one


@kernel
def _take_differences(value, mean, gain, plain, old, total):  # type: ignore[no-untyped-def]
    """As `_take_plain`, for a row's differences from the background, in steps of 1 / `STEPS`."""
    white = np.float32(255.0 * STEPS)
    for j in range(plain.size):
        base = np.int32(min(gain * np.float32(mean[j]), white) + np.float32(0.5))
        new = (np.int32(STEPS) * np.int32(value[j]) - base) * plain[j]
        total[j] += new - old[j]
        old[j] = new


@kernel
def sum_across(part, side, total):  # type: ignore[no-untyped-def]
    """total[j] = part[j] + ... + part[j + side - 1]; part (n + side - 1,), total (n,), side odd."""
    n = total.size
    if side == 7:
        for j in range(n):
            left = part[j] + part[j + 1] + part[j + 2]
            total[j] = left + part[j + 3] + part[j + 4] + part[j + 5] + part[j + 6]
        return
    for j in range(n):
        total[j] = part[j]
    for shift in range(1, side, 2):
        one = part[shift : shift + n]
        other = part[shift + 1 : shift + 1 + n]
        for j in range(n):
            total[j] += one[j] + other[j]


@kernel
def _mirror_ends(row, radius):  # type: ignore[no-untyped-def]
    """Fill the first and last ``radius`` values of a row with those mirrored at its ends."""
    n = row.size - 2 * radius
    for k in range(1, radius + 1):
        row[radius - k] = row[radius + _mirrored(-k, n)]
        row[radius + n - 1 + k] = row[radius + _mirrored(n - 1 + k, n)]


@kernel
def _limits(count, limit, least, out):  # type: ignore[no-untyped-def]
    for j in range(out.size):
        out[j] = max(limit * count[j], least)


@kernel
def _mark_beyond(patch, limit, label):  # type: ignore[no-untyped-def]
    for j in range(label.size):
        far = abs(patch[j]) > limit[j]
        label[j] = np.uint8(WEAK) if far & (label[j] == 0) else label[j]


@kernel
def _weak_rows(planes, mean, gain, radius, limit, least, left, top, rings, total, labels):  # type: ignore[no-untyped-def]
    """See `mark_weak`; planes (c, a, b), rings (side + 1, c + 1, b), total (c + 2, b + 2 r)."""
    channels = planes.shape[0]
    rows, columns = labels.shape
    side = 2 * radius + 1
    plain, limits = rings[side, 0], rings[side, 1]
    patch = total[channels + 1, :columns]
    last = radius + columns
    for s in range(-radius, rows + radius):
        v = _mirrored(s, rows)
        old = rings[(s + radius) % side]
        if 0 <= s < rows - ROWS_AHEAD:
            for c in range(channels):
                prefetch(mean[c, top + s + ROWS_AHEAD, left : left + columns])
                prefetch(planes[c, s + ROWS_AHEAD])
        _take_plain(labels[v], plain, old[channels], total[channels, radius:last])
        for c in range(channels):
            base = mean[c, top + v, left : left + columns]
            steps = gain[c] * np.float32(STEPS / LEVELS)
            _take_differences(planes[c, v], base, steps, plain, old[c], total[c, radius:last])
        i = s - radius
        if i < 0:
            continue
        _mirror_ends(total[channels], radius)
        sum_across(total[channels], side, patch)
        _limits(patch, limit, least, limits)
        for c in range(channels):
            _mirror_ends(total[c], radius)
            sum_across(total[c], side, patch)
            _mark_beyond(patch, limits, labels[i])


def mark_weak(
    planes: NDArray[np.uint8],
    mean: NDArray[np.uint16],
    gain: NDArray[np.float32],
    labels: NDArray[np.uint8],
    corner: tuple[int, int],
    *,
    radius: int,
    limit: float,
    least_share: float,
) -> None:
    """Label background as weak where the mean of the patch around it differs from the background.

    The means are those of the background pixels of square patches, mirrored at the part's border.

    Args:
        planes: (c, a, b), channels of a part of an image.
        mean: (c, h, w) the background of the whole image, in steps of 1 / `LEVELS` grey level.
        gain: (c,) brightness of the image relative to the background's.
        labels: (a, b), changed: 0 becomes `WEAK`.
        corner: the part's first column and row in the image.
        radius: of the patches, px.
        limit: least difference of a mean, grey levels.
        least_share: lower bound of the fraction of background pixels, by which sums are divided.
    """
    channels, _, columns = planes.shape
    side = 2 * radius + 1
    rings = np.zeros((side + 1, max(channels + 1, 2), columns), dtype=np.int32)
    total = np.zeros((channels + 2, columns + 2 * radius), dtype=np.int32)
    steps = np.int32(round(STEPS * limit))
    _weak_rows(
        planes, mean, gain, radius, steps, np.int32(least_share * side * side * steps), corner[0],
        corner[1], rings, total, labels,
    )  # fmt: skip
