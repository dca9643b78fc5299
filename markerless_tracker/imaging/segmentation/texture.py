"""Texture test: a shadow keeps the background's pattern, a body hides it.

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
from markerless_tracker.imaging.images import Image
from markerless_tracker.imaging.region import Region
from markerless_tracker.imaging.segmentation.kernels import FOREGROUND, SHADOW
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
# Standard deviations of the noise within which a pixel agrees with a window's light.
_AGREE = 3.5


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


@kernel
def apply_light(  # type: ignore[no-untyped-def]
    image, mean, gain, agree, radius, protect, reveal, left, top, light, near_valid, part, corner,
    examined, labels,
):  # fmt: skip
    """Correct labels by the light of the windows around each pixel, in place.

    A pixel that agrees with the light of any valid window around it is background, or shadow if its
    label was not background. Otherwise, if its own window is covered, shadow becomes foreground
    with ``protect``, and background becomes foreground with ``reveal``.

    Args:
        image, mean, gain, left, top, light: as in `window_light`; light is 0 where not valid,
            below 0 where covered.
        agree: largest difference with which a pixel agrees, grey levels.
        radius: of the windows, px.
        protect, reveal: as for `correct_labels`.
        near_valid: (a, b), not 0 if a window within the radius is valid.
        part: (left, top, right, bottom) of the light's array to correct.
        corner: column and row of the labels' array where that array begins.
        examined: (c, d) shadow and foreground are corrected only where this is not 0.
        labels: (c, d).
    """
    rows, columns = light.shape
    for i in range(part[1], part[3]):
        for j in range(part[0], part[2]):
            y = corner[1] + i
            x = corner[0] + j
            label = labels[y, x]
            if label == 0:
                if not reveal or light[i, j] >= 0.0:
                    continue
            elif examined[y, x] == 0 or (label == SHADOW and not protect):
                continue
            explained = False
            if near_valid[i, j] != 0:
                value = np.float32(image[i, j])
                base = mean[top + i, left + j] * gain
                base = min(base, np.float32(255.0)) if image[i, j] >= CLIPPED else base
                for di in range(max(i - radius, 0), min(i + radius + 1, rows)):
                    for dj in range(max(j - radius, 0), min(j + radius + 1, columns)):
                        p = light[di, dj]
                        if p > 0.0 and abs(value - p * base) <= agree:
                            explained = True
                            break
                    if explained:
                        break
            if explained:
                if label != 0:
                    labels[y, x] = SHADOW
            elif light[i, j] < 0.0 and protect:
                labels[y, x] = FOREGROUND


def correction_radius_px(radius: int) -> int:
    """Radius of the neighbourhood that the correction of a pixel depends on, px."""
    return SPREAD_PX + 2 * radius


def correct_labels(
    grey: Image,
    mean: NDArray[np.float32],
    gain: float,
    sigma: float,
    labels: NDArray[np.uint8],
    window: Region,
    part: Region,
    seen: Region,
    *,
    examined: NDArray[np.uint8],
    radius: int,
    light: tuple[float, float],
    protect: bool,
    reveal: bool,
) -> None:
    """Correct labels by texture, in place.

    Args:
        grey: (c, d) uint8, the part `seen` of the image.
        mean: (h, w) grey background of the whole image.
        gain: brightness of the image relative to the background's.
        sigma: standard deviation of the sensor's noise, grey levels.
        labels: (a, b) of a window: 0 background, 127 shadow, 255 foreground.
        window: the window's place in the image.
        part: the corrected region, inside the window.
        seen: place of ``grey``: the part and `correction_radius_px` around it, cut at the image's
            border.
        examined: (a, b), 0 where shadow and foreground are not corrected.
        radius: of the windows, px.
        light: least and largest light of a shadow.
        protect: whether shadow may become foreground.
        reveal: whether background may become foreground.
    """
    found = np.empty((2, *grey.shape), dtype=np.float32)
    one = np.float32(gain)
    noise = np.float32(sigma**2)
    window_light(grey, mean, one, noise, radius, seen.left, seen.top, found[0])
    spread_light(found[0], found[1])
    valid = np.empty(grey.shape, dtype=np.uint8)
    lit(found[1], np.float32(light[0]), np.float32(light[1]), valid)
    square = np.ones((2 * radius + 1, 2 * radius + 1), dtype=np.uint8)
    near_valid = np.asarray(cv2.dilate(valid, square), dtype=np.uint8)
    corner = (seen.left - window.left, seen.top - window.top)
    apply_light(
        grey, mean, one, np.float32(_AGREE * sigma), radius, protect, reveal, seen.left, seen.top,
        found[1], near_valid, part.relative_to(seen), corner, examined, labels,
    )  # fmt: skip
