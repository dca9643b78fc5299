"""Light of the windows of an image: how bright the background's pattern shows in each.

Brightness does not separate a hard shadow from dark trousers, nor grey clothes from a grey wall of
the same brightness. In a small window, image I and background B are compared by
e^2 = var(I - p B) with the light p = mean(I) / mean(B). If the window shows the background in any
light, e^2 is the variance of the sensor's noise. If something covers the background, e^2 is larger
by p^2 var(B), the pattern. A window is decided only if its pattern exceeds the noise.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from markerless_tracker.compiled import compiled, kernel
from markerless_tracker.imaging.prefetch import ROWS_AHEAD, prefetch
from markerless_tracker.imaging.segmentation.patches import sum_across

SHOWN_LEAST, HIDDEN_LEAST = 6.0, 6.0
"""Least ratio of the pattern's variance to the noise's to decide that it is shown, or hidden."""
SAME, OTHER = 0.15, 0.85
"""e^2 minus noise variance, relative to the pattern: below SAME shown, above OTHER hidden."""
UNKNOWN = 100.0
"""Added to the light of windows without a pattern."""
STEP = 0.006
"""Largest change of light between neighbouring pixels of one shadow."""
SPREAD_PX = 24
"""Distance over which light spreads to windows without a pattern: along rows, then columns."""
CLIPPED = 250
"""Grey level from which on an image may be white."""
# Largest integer whose square fits into 31 bits.
_LARGEST_ROOT = 46340


# Loops over one row with few arrays each, which the compiler vectorises.
@kernel
def _slide(total, came, gone):  # type: ignore[no-untyped-def]
    """Column sums of a window that moves down by a row: one row enters, one leaves."""
    for j in range(came.size):
        total[j] += came[j] - gone[j]


@kernel
def _slide_product(total, came_x, came_y, gone_x, gone_y):  # type: ignore[no-untyped-def]
    """As `_slide`, for products of two images."""
    for j in range(came_x.size):
        total[j] += came_x[j] * came_y[j] - gone_x[j] * gone_y[j]


# With NumPy's error model the loop has no branch to test for division by zero.
@kernel
def _light_of_sums(a, b, aa, ab, bb, across, down, noise, out):  # type: ignore[no-untyped-def]
    """Fill out (w,) with the light of a row of windows, as `window_light` describes it.

    Args:
        a, b: (w,) int32 sums over each window of the image and of the background.
        aa, ab, bb: (w,) int32 sums of their products.
        across, down: columns (w,) and rows of the windows.
        noise: variance of the sensor's noise.
    """
    for j in range(out.size):
        # n times a sum of squares fits into 31 bits. Without the
        # casts the products would have 64 bits, for which there are few vector instructions.
        n = np.int32(down * across[j])
        share = np.float32(1.0) / np.float32(n)
        square_a, square_b = np.int32(a[j] * a[j]), np.int32(b[j] * b[j])
        product = np.int32(a[j] * b[j])
        var_a = np.float32(np.int32(np.int32(n * aa[j]) - square_a)) * share * share
        cov = np.float32(np.int32(np.int32(n * ab[j]) - product)) * share * share
        var_b = np.float32(np.int32(np.int32(n * bb[j]) - square_b)) * share * share
        p = np.float32(a[j]) / max(np.float32(b[j]), np.float32(1e-6))
        pattern = p * p * var_b
        rest = var_a - np.float32(2.0) * p * cov + pattern - noise
        found = np.float32(UNKNOWN) + p if rest < noise else np.float32(0.0)
        hidden = (pattern >= np.float32(HIDDEN_LEAST) * noise) & (
            rest > np.float32(OTHER) * pattern
        )
        found = np.float32(-1.0) if hidden else found
        shown = (pattern >= np.float32(SHOWN_LEAST) * noise) & (rest < np.float32(SAME) * pattern)
        found = p if shown else found
        out[j] = found if (a[j] > 0) & (b[j] > 0) else np.float32(0.0)


@kernel
def _whole_levels(image, mean, gain, most, a, b):  # type: ignore[no-untyped-def]
    """Fill a with a row of the image and b with that of the background, in whole grey levels.

    Where the image is white, the background in more light is white, too; else it is `most` at most.
    """
    for j in range(a.size):
        a[j] = np.int32(image[j])
    white = np.float32(255.0)
    for j in range(b.size):
        bound = white if image[j] >= CLIPPED else most
        b[j] = np.int32(min(mean[j] * gain, bound) + np.float32(0.5))


@compiled()
def window_light(image, mean, gain, noise, radius, left, top, light):  # type: ignore[no-untyped-def]
    """Light of the windows around the pixels of a part of an image.

    Windows end at the part's border.

    Args:
        image: (a, b) uint8, the part.
        mean: (h, w) float32, the background; the part begins at (left, top) of it.
        gain, noise: brightness relative to the background's, and variance of the noise.
        radius: of the windows, px.
        left, top: the part's first column and row in the image.
        light: (a, b) float32, written: p > 0 where the window shows the background in the light p;
            -1 where something covers the background; UNKNOWN + p without a pattern; 0 if undecided.
    """
    rows, columns = light.shape
    side = 2 * radius + 1
    most = np.float32(_LARGEST_ROOT // (side * side))
    # Column sums of integers (exact in any order), with room for windows at the sides.
    sums = np.zeros((5, columns + 2 * radius), dtype=np.int32)
    window = np.empty((5, columns), dtype=np.int32)
    # Ring buffer of the window's rows; rows beyond the part are 0.
    grey = np.zeros((side + 1, columns), dtype=np.int32)
    base = np.zeros((side + 1, columns), dtype=np.int32)
    across = np.empty(columns, dtype=np.int32)
    _light_of_rows(
        image, mean, gain, noise, radius, left, top, most, sums, window, grey, base, across, light
    )


@kernel
def _light_of_rows(  # type: ignore[no-untyped-def]
    image, mean, gain, noise, radius, left, top, most, sums, window, grey, base, across, light
):
    """The loop of `window_light`, with its working memory."""
    rows, columns = light.shape
    side = 2 * radius + 1
    for j in range(columns):
        across[j] = min(j + radius, columns - 1) - max(j - radius, 0) + 1
    for v in range(rows + radius):
        # In the ring, the row that leaves the window follows the one that enters.
        came = v % (side + 1)
        gone = (v + 1) % (side + 1)
        a, b = grey[came], base[came]
        old_a, old_b = grey[gone], base[gone]
        if v + ROWS_AHEAD < rows:
            prefetch(mean[top + v + ROWS_AHEAD, left : left + columns])
        if v < rows:
            _whole_levels(image[v], mean[top + v, left : left + columns], gain, most, a, b)
        else:
            a[:] = 0
            b[:] = 0
        _slide(sums[0, radius : radius + columns], a, old_a)
        _slide(sums[1, radius : radius + columns], b, old_b)
        _slide_product(sums[2, radius : radius + columns], a, a, old_a, old_a)
        _slide_product(sums[3, radius : radius + columns], a, b, old_a, old_b)
        _slide_product(sums[4, radius : radius + columns], b, b, old_b, old_b)
        i = v - radius
        if i < 0:
            continue
        for k in range(5):
            sum_across(sums[k], side, window[k])
        down = np.int32(min(i + radius, rows - 1) - max(i - radius, 0) + 1)
        _light_of_sums(
            window[0], window[1], window[2], window[3], window[4], across, down, noise, light[i]
        )


@kernel
def _spread_row(row, near, steps, out):  # type: ignore[no-untyped-def]
    """Spread light from the row before to windows of a row without a pattern, if it is similar.

    Args:
        row: (n,) light of the row.
        near: (n,) light that the row before passes on, 0 = none; becomes that of this row.
        steps: (n,) number of rows that have passed it on; updated, too.
        out: (n,) written where light is spread to.
    """
    zero, one = np.float32(0.0), np.float32(1.0)
    # Selections of values instead of branches, which the compiler vectorises.
    for j in range(row.size):
        p, before, passed, kept = row[j], near[j], steps[j], out[j]
        own = p - np.float32(UNKNOWN)
        change = own - before
        change = change if change > zero else -change
        plain = one if p >= np.float32(UNKNOWN) else zero
        taken = plain if change <= np.float32(STEP) else zero
        taken = taken if before > zero else zero
        taken = taken if passed < np.float32(SPREAD_PX) else zero
        out[j] = own if taken > zero else kept
        lit_itself = p if p > zero else zero
        lit_itself = zero if plain > zero else lit_itself
        near[j] = own if taken > zero else lit_itself
        steps[j] = passed + one if taken > zero else zero


@kernel
def _spread_down_and_up(light, near, steps, spread):  # type: ignore[no-untyped-def]
    """Spread light (a, b) along columns; see `spread_light`. near, steps: (b,), working memory."""
    rows = light.shape[0]
    near[:] = 0.0
    steps[:] = 0.0
    for i in range(rows):
        _spread_row(light[i], near, steps, spread[i])
    near[:] = 0.0
    steps[:] = 0.0
    for i in range(rows - 1, -1, -1):
        _spread_row(light[i], near, steps, spread[i])


def spread_light(light: NDArray[np.float32], spread: NDArray[np.float32]) -> None:
    """Spread light to neighbouring windows without a pattern, if their own light is similar.

    It spreads along rows, then along columns, over at most `SPREAD_PX` each, so that a result
    depends on a bounded neighbourhood. light (a, b) is changed; spread (a, b) is written.
    """
    # Along rows each step needs the one before; along columns many steps are made at once.
    transposed = np.asarray(cv2.transpose(light), dtype=np.float32)
    found = transposed.copy()
    near, steps = np.empty((2, max(light.shape)), dtype=np.float32)
    _spread_down_and_up(transposed, near[: len(light)], steps[: len(light)], found)
    light[...] = cv2.transpose(found)
    spread[...] = light
    columns = light.shape[1]
    _spread_down_and_up(light, near[:columns], steps[:columns], spread)


@kernel
def lit(light, least, most, valid):  # type: ignore[no-untyped-def]
    """Set light outside of [least, most] to 0 or less; valid (a, b) uint8 is 1 inside."""
    for i in range(light.shape[0]):
        row = light[i]
        out = valid[i]
        for j in range(row.size):
            p = row[j]
            good = (p >= least) & (p <= most)
            out[j] = good
            row[j] = p if good else min(p, np.float32(0.0))
