"""Compiled foreground and shadow test of an image, in one pass.

The loops release the interpreter lock, so that the caller's threads can segment several cameras at
once. They are not `parallel=True`: numba's own threads allow one caller at a time.
"""

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.compiled import inlined, kernel
from markerless_tracker.imaging.prefetch import ROWS_AHEAD, prefetch

FOREGROUND = 255
SHADOW = 127
WEAK = 64
"""Labels of pixels; 0 is background. The mean of the patch around a weak pixel differs from the
background, though no single pixel does (`patches.mark_weak`)."""
LEVELS = 256
"""Integer steps per grey level of the means in `coarse`."""


def coarse(
    mean: NDArray[np.float32], scale: NDArray[np.float32]
) -> tuple[NDArray[np.uint16], np.float32]:
    """Means and scales (c, h, w) as integers (2, c, h, w), and the number of steps of scale 1.

    Integers of 16 bits halve the memory traffic, which limits the speed of the pass over an image.
    The error of means is at most 1/512 grey level; that of scales is below a thousandth if no scale
    is 60 times another.
    """
    unit = np.float32(65535.0 / max(float(scale.max()), 1e-9))
    steps = np.stack([np.clip(mean, 0.0, 255.0) * np.float32(LEVELS), scale * unit])
    return np.rint(steps).astype(np.uint16), unit


@inlined
def hue_deg(blue, green, red, value, chroma):  # type: ignore[no-untyped-def]
    """Hue in degrees, [0, 360), as OpenCV defines it; ``chroma`` = max - min > 0.

    It selects values instead of branching, so that loops with it can be vectorised.
    """
    blue_red, red_green, green_blue = blue - red, red - green, green - blue
    along = blue_red if value == green else red_green
    start = np.float32(120.0) if value == green else np.float32(240.0)
    along = green_blue if value == red else along
    start = np.float32(0.0) if value == red else start
    hue = start + np.float32(60.0) * along / chroma
    turned = hue + np.float32(360.0)
    return turned if hue < np.float32(0.0) else hue


@inlined
def is_shadow(b, g, r, mean_b, mean_g, mean_r, rule):  # type: ignore[no-untyped-def]
    """Eq 12 for a colour pixel (float32 BGR) and its background; ``rule``: `shadow.shadow_rule`."""
    value = max(b, g, r)
    mean_value = max(mean_b, mean_g, mean_r)
    if value < rule[0] * mean_value or value > rule[1] * mean_value:
        return False
    chroma = value - min(b, g, r)
    mean_chroma = mean_value - min(mean_b, mean_g, mean_r)
    # S = chroma / value, and 0 for black.
    saturation = chroma / value if value > np.float32(0.0) else np.float32(0.0)
    mean_saturation = mean_chroma / mean_value if mean_value > np.float32(0.0) else np.float32(0.0)
    if saturation - mean_saturation > rule[2]:
        return False
    # The hue of dark pixels is noise: it is compared only if the shadowed background has colour.
    if mean_chroma * value < rule[4] * mean_value:
        return True
    if chroma <= np.float32(0.0) or mean_chroma <= np.float32(0.0):
        return chroma == mean_chroma
    difference = abs(
        hue_deg(b, g, r, value, chroma) - hue_deg(mean_b, mean_g, mean_r, mean_value, mean_chroma)
    )
    return min(difference, np.float32(360.0) - difference) <= rule[3]


# Loops over one row with few arrays each, which the compiler vectorises.
@kernel
def _add_square(value, mean, scale, gain, distance):  # type: ignore[no-untyped-def]
    """Add ((value - gain mean) scale)^2 of one row; mean and scale are integers."""
    white = np.float32(255.0)
    for j in range(distance.size):
        x = (np.float32(value[j]) - min(gain * np.float32(mean[j]), white)) * np.float32(scale[j])
        distance[j] += x * x


@kernel
def _beyond(distance, limit, row, marks):  # type: ignore[no-untyped-def]
    for j in range(distance.size):
        marks[j] = np.uint8(255) if distance[j] > limit else np.uint8(0)
    for j in range(distance.size):
        row[j] = marks[j]


# `is_shadow` of many pixels, with selections of values instead of branches, which the compiler
# vectorises. If half of the pixels are marked, this takes a quarter of the time of branches.
@kernel
def _split_marked(blue, green, red, first_b, first_g, first_r, gain, rule, marks, row):  # type: ignore[no-untyped-def]
    """Fill a part of a row: shadow or foreground at marked pixels, else 0.

    Args:
        blue, green, red: (n,) uint8.
        first_b, first_g, first_r: (n,) means of the first Gaussians, of `coarse`.
        gain: 3 float32, brightness relative to the background's in those steps.
        rule: as for `is_shadow`.
        marks: (n,) uint8, not 0 if a pixel is not background.
        row: (n,) uint8, written.
    """
    zero, one, white = np.float32(0.0), np.float32(1.0), np.float32(255.0)
    turn, never = np.float32(360.0), np.float32(np.inf)
    shadow, foreground, background = np.uint8(SHADOW), np.uint8(FOREGROUND), np.uint8(0)
    gain_b, gain_g, gain_r = gain
    darkest, faintest, saturation_max, hue_max_deg, chroma_min = rule
    for j in range(row.size):
        mark, b, g, r = marks[j], np.float32(blue[j]), np.float32(green[j]), np.float32(red[j])
        mean_b = gain_b * np.float32(first_b[j])
        mean_g = gain_g * np.float32(first_g[j])
        mean_r = gain_r * np.float32(first_r[j])
        mean_b = mean_b if mean_b < white else white
        mean_g = mean_g if mean_g < white else white
        mean_r = mean_r if mean_r < white else white
        value = b if b > g else g
        value = value if value > r else r
        least = b if b < g else g
        least = least if least < r else r
        mean_value = mean_b if mean_b > mean_g else mean_g
        mean_value = mean_value if mean_value > mean_r else mean_r
        mean_least = mean_b if mean_b < mean_g else mean_g
        mean_least = mean_least if mean_least < mean_r else mean_r
        chroma, mean_chroma = value - least, mean_value - mean_least
        # The result is not used if a divisor is 0.
        by_value = value if value > zero else one
        by_mean_value = mean_value if mean_value > zero else one
        by_chroma = chroma if chroma > zero else one
        by_mean_chroma = mean_chroma if mean_chroma > zero else one
        hue = hue_deg(b, g, r, value, by_chroma)
        mean_hue = hue_deg(mean_b, mean_g, mean_r, mean_value, by_mean_chroma)
        apart = abs(hue - mean_hue)
        other_way = turn - apart
        apart = apart if apart < other_way else other_way
        without_hue = zero if chroma == mean_chroma else never
        apart = apart if chroma > zero else without_hue
        apart = apart if mean_chroma > zero else without_hue
        apart = zero if mean_chroma * value < chroma_min * mean_value else apart
        more_saturated = chroma / by_value - mean_chroma / by_mean_value
        label = shadow if apart <= hue_max_deg else foreground
        label = label if more_saturated <= saturation_max else foreground
        label = label if value >= darkest * mean_value else foreground
        label = label if value <= faintest * mean_value else foreground
        row[j] = label if mark != 0 else background


def make_row(columns: int) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
    """Working memory for labels of parts of so many columns: distances, and marks in words."""
    words = (columns + 7) // 8
    return np.empty(columns, dtype=np.float32), np.zeros(8 * words, dtype=np.uint8)


@kernel
def label_colour(  # type: ignore[no-untyped-def]
    planes, first, unit, mean, scale, gain, rule, left, top, distance, marks, labels
):
    """Label a part of a colour image: 0 background, 127 shadow, 255 foreground.

    Args:
        planes: (3, a, b) uint8, blue, green and red of the part.
        first, unit: the first Gaussians, of `coarse`, which decide most pixels.
        mean: (k, 3, h, w) float32, grey levels, of the k Gaussians of each pixel.
        scale: (k, 3, h, w) float32, 1 / (sigma * sqrt(limit)): the foreground test is |.|^2 > 1.
        gain: (3,) float32, brightness of the image relative to the background's.
        rule: of `shadow.shadow_rule`.
        left, top: the part's first column and row in the image.
        distance, marks: of `make_row`, working memory.
        labels: (a, b) uint8, written.
    """
    one, white = np.float32(1.0), np.float32(255.0)
    level = np.float32(1.0 / LEVELS)
    modes = mean.shape[0]
    rows, columns = labels.shape
    steps = (gain[0] * level, gain[1] * level, gain[2] * level)
    # Groups of eight background pixels are skipped at once.
    words = marks.view(np.uint64)
    for i in range(rows):
        v = top + i
        # Whole rows first, without branches: most pixels are background of the first Gaussian.
        distance[:] = 0.0
        if i + ROWS_AHEAD < rows:
            for c in range(3):
                prefetch(first[0, c, v + ROWS_AHEAD, left : left + columns])
                prefetch(first[1, c, v + ROWS_AHEAD, left : left + columns])
        for c in range(3):
            base = first[0, c, v, left : left + columns]
            narrow = first[1, c, v, left : left + columns]
            _add_square(planes[c, i], base, narrow, steps[c], distance)
        row = labels[i]
        _beyond(distance, unit * unit, row, marks)
        word = 0
        while word < words.size:
            if words[word] == 0:
                word += 1
                continue
            begin = 8 * word
            while word < words.size and words[word] != 0:
                word += 1
            end = min(8 * word, columns)
            begin_u, end_u = left + begin, left + end
            # One-dimensional slices, whose elements the compiler knows to be adjacent.
            _split_marked(
                planes[0, i, begin:end], planes[1, i, begin:end], planes[2, i, begin:end],
                first[0, 0, v, begin_u:end_u], first[0, 1, v, begin_u:end_u],
                first[0, 2, v, begin_u:end_u], steps, rule, marks[begin:end], row[begin:end],
            )  # fmt: skip
            if modes == 1:
                continue
            for j in range(begin, end):
                if marks[j] == 0:
                    continue
                b = np.float32(planes[0, i, j])
                g = np.float32(planes[1, i, j])
                r = np.float32(planes[2, i, j])
                label = row[j]
                for k in range(1, modes):
                    mean_b = min(gain[0] * mean[k, 0, v, left + j], white)
                    mean_g = min(gain[1] * mean[k, 1, v, left + j], white)
                    mean_r = min(gain[2] * mean[k, 2, v, left + j], white)
                    x = (b - mean_b) * scale[k, 0, v, left + j]
                    y = (g - mean_g) * scale[k, 1, v, left + j]
                    z = (r - mean_r) * scale[k, 2, v, left + j]
                    if x * x + y * y + z * z <= one:
                        label = 0
                        break
                    if label == FOREGROUND and is_shadow(b, g, r, mean_b, mean_g, mean_r, rule):
                        label = SHADOW
                row[j] = label


@kernel
def label_grey(  # type: ignore[no-untyped-def]
    image, first, unit, mean, scale, gain, rule, left, top, distance, marks, labels
):
    """As `label_colour` with one channel: image (a, b), mean and scale (k, 1, h, w), gain (1,).

    Only the ratio of brightness decides on shadow.
    """
    one = np.float32(1.0)
    level = np.float32(1.0 / LEVELS)
    white = np.float32(255.0)
    modes = mean.shape[0]
    rows, columns = labels.shape
    gain_v = gain[0]
    # Groups of eight background pixels are skipped at once.
    words = marks.view(np.uint64)
    for i in range(rows):
        v = top + i
        pixel = image[i]
        base = first[0, 0, v, left : left + columns]
        narrow = first[1, 0, v, left : left + columns]
        distance[:] = 0.0
        _add_square(pixel, base, narrow, gain_v * level, distance)
        row = labels[i]
        _beyond(distance, unit * unit, row, marks)
        for word in range(words.size):
            if words[word] == 0:
                continue
            for j in range(8 * word, min(8 * word + 8, columns)):
                if marks[j] == 0:
                    continue
                value = np.float32(pixel[j])
                expected = min(gain_v * level * np.float32(first[0, 0, v, left + j]), white)
                shaded = rule[0] * expected <= value and value <= rule[1] * expected
                label = SHADOW if shaded else FOREGROUND
                for k in range(1, modes):
                    expected = min(gain_v * mean[k, 0, v, left + j], white)
                    x = (value - expected) * scale[k, 0, v, left + j]
                    if x * x <= one:
                        label = 0
                        break
                    if rule[0] * expected <= value and value <= rule[1] * expected:
                        label = SHADOW
                row[j] = label
