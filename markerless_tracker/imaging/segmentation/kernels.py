"""Compiled foreground and shadow test of an image, in one pass.

The loops release the interpreter lock, so that the caller's threads can segment several cameras at
once. They are not `parallel=True`: numba's own threads allow one caller at a time.
"""

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.compiled import compiled

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

    Integers of 16 bits halve the memory traffic, which limits the pass over an image. The error of
    means is at most 1/512 grey level, that of scales below a thousandth if none is 60 times
    another.
    """
    unit = np.float32(65535.0 / max(float(scale.max()), 1e-9))
    steps = np.stack([np.clip(mean, 0.0, 255.0) * np.float32(LEVELS), scale * unit])
    return np.rint(steps).astype(np.uint16), unit


@compiled(inline="always")
def hue_deg(blue, green, red, value, chroma):  # type: ignore[no-untyped-def]
    """Hue in degrees, [0, 360), as OpenCV defines it; ``chroma`` = max - min > 0."""
    if value == red:
        hue = np.float32(60.0) * (green - blue) / chroma
    elif value == green:
        hue = np.float32(120.0) + np.float32(60.0) * (blue - red) / chroma
    else:
        hue = np.float32(240.0) + np.float32(60.0) * (red - green) / chroma
    if hue < np.float32(0.0):
        hue += np.float32(360.0)
    return hue


@compiled(inline="always")
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
    # Hue of dark pixels is noise: it is compared where the shadowed background would have colour.
    if mean_chroma * value < rule[4] * mean_value:
        return True
    if chroma <= np.float32(0.0) or mean_chroma <= np.float32(0.0):
        return chroma == mean_chroma
    difference = abs(
        hue_deg(b, g, r, value, chroma) - hue_deg(mean_b, mean_g, mean_r, mean_value, mean_chroma)
    )
    return min(difference, np.float32(360.0) - difference) <= rule[3]


# Loops over one row with few arrays each, which the compiler vectorises.
@compiled()
def _add_square(value, mean, scale, gain, distance):  # type: ignore[no-untyped-def]
    """Add ((value - gain mean) scale)^2 of one row; mean and scale are integers."""
    white = np.float32(255.0)
    for j in range(distance.size):
        x = (np.float32(value[j]) - min(gain * np.float32(mean[j]), white)) * np.float32(scale[j])
        distance[j] += x * x


@compiled()
def _beyond(distance, limit, row, marks):  # type: ignore[no-untyped-def]
    for j in range(distance.size):
        marks[j] = np.uint8(255) if distance[j] > limit else np.uint8(0)
    for j in range(distance.size):
        row[j] = marks[j]


@compiled()
def label_colour(planes, first, unit, mean, scale, gain, rule, left, top, labels):  # type: ignore[no-untyped-def]
    """Label a part of a colour image: 0 background, 127 shadow, 255 foreground.

    Args:
        planes: (3, a, b) uint8, blue, green and red: the part alone.
        first, unit: the first Gaussians, of `coarse`; most pixels are decided by them.
        mean: (k, 3, h, w) float32, grey levels, of the k Gaussians of each pixel.
        scale: (k, 3, h, w) float32, 1 / (sigma * sqrt(limit)): the foreground test is |.|^2 > 1.
        gain: (3,) float32, brightness of the image relative to the background's.
        rule: of `shadow.shadow_rule`.
        left, top: the part's first column and row in the image.
        labels: (a, b) uint8, written.
    """
    one = np.float32(1.0)
    level = np.float32(1.0 / LEVELS)
    white = np.float32(255.0)
    modes = mean.shape[0]
    rows, columns = labels.shape
    gain_b, gain_g, gain_r = gain[0], gain[1], gain[2]
    distance = np.empty(columns, dtype=np.float32)
    # Groups of eight background pixels are skipped at once.
    marks = np.zeros((columns + 7) // 8 * 8, dtype=np.uint8)
    words = marks.view(np.uint64)
    for i in range(rows):
        v = top + i
        split = planes[:, i]
        # First whole rows without branches: most pixels are background of the first Gaussian.
        distance[:] = 0.0
        for c in range(3):
            base = first[0, c, v, left : left + columns]
            narrow = first[1, c, v, left : left + columns]
            _add_square(split[c], base, narrow, gain[c] * level, distance)
        row = labels[i]
        _beyond(distance, unit * unit, row, marks)
        for word in range(words.size):
            if words[word] == 0:
                continue
            for j in range(8 * word, min(8 * word + 8, columns)):
                if marks[j] == 0:
                    continue
                b = np.float32(split[0, j])
                g = np.float32(split[1, j])
                r = np.float32(split[2, j])
                mean_b = min(gain_b * level * np.float32(first[0, 0, v, left + j]), white)
                mean_g = min(gain_g * level * np.float32(first[0, 1, v, left + j]), white)
                mean_r = min(gain_r * level * np.float32(first[0, 2, v, left + j]), white)
                label = SHADOW if is_shadow(b, g, r, mean_b, mean_g, mean_r, rule) else FOREGROUND
                for k in range(1, modes):
                    mean_b = min(gain_b * mean[k, 0, v, left + j], white)
                    mean_g = min(gain_g * mean[k, 1, v, left + j], white)
                    mean_r = min(gain_r * mean[k, 2, v, left + j], white)
                    x = (b - mean_b) * scale[k, 0, v, left + j]
                    y = (g - mean_g) * scale[k, 1, v, left + j]
                    z = (r - mean_r) * scale[k, 2, v, left + j]
                    if x * x + y * y + z * z <= one:
                        label = 0
                        break
                    if label == FOREGROUND and is_shadow(b, g, r, mean_b, mean_g, mean_r, rule):
                        label = SHADOW
                row[j] = label


@compiled()
def label_grey(image, first, unit, mean, scale, gain, rule, left, top, labels):  # type: ignore[no-untyped-def]
    """As `label_colour` with one channel: image (a, b), mean and scale (k, 1, h, w), gain (1,).

    The ratio of brightness alone decides on shadow.
    """
    one = np.float32(1.0)
    level = np.float32(1.0 / LEVELS)
    white = np.float32(255.0)
    modes = mean.shape[0]
    rows, columns = labels.shape
    gain_v = gain[0]
    distance = np.empty(columns, dtype=np.float32)
    # Groups of eight background pixels are skipped at once.
    marks = np.zeros((columns + 7) // 8 * 8, dtype=np.uint8)
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
