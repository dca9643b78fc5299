"""The compiled pass over an image: foreground test and shadow test in one, no allocation.

Plain loops that release the interpreter lock, so that cameras can be segmented in threads of the
caller. Not `parallel=True`: numba's own threads must not be entered by two callers at once.
All in one file: numba's cache does not notice changes in functions inlined from another.
"""

import numba
import numpy as np

FOREGROUND = 255
SHADOW = 127


@numba.njit(cache=True, nogil=True, inline="always")  # type: ignore[untyped-decorator]
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


@numba.njit(cache=True, nogil=True, inline="always")  # type: ignore[untyped-decorator]
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
    # In the dark hue is noise: it is compared where the shadowed background would have colour.
    if mean_chroma * value < rule[4] * mean_value:
        return True
    if chroma <= np.float32(0.0) or mean_chroma <= np.float32(0.0):
        return chroma == mean_chroma
    turn = abs(
        hue_deg(b, g, r, value, chroma) - hue_deg(mean_b, mean_g, mean_r, mean_value, mean_chroma)
    )
    return min(turn, np.float32(360.0) - turn) <= rule[3]


@numba.njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def label_colour(image, mean, scale, rule, labels):  # type: ignore[no-untyped-def]
    """Label every pixel of a colour image: 0 background, 127 shadow, 255 foreground.

    Args:
        image: (h, w, 3) uint8, BGR.
        mean: (h, w, 3) float32, grey levels.
        scale: (h, w, 3) float32, 1 / (sigma * sqrt(limit)): the foreground test is |.|^2 > 1.
        rule: of `shadow.shadow_rule`.
        labels: (h, w) uint8, written.
    """
    one = np.float32(1.0)
    height, width = labels.shape
    for v in range(height):
        for u in range(width):
            b = np.float32(image[v, u, 0])
            g = np.float32(image[v, u, 1])
            r = np.float32(image[v, u, 2])
            x = (b - mean[v, u, 0]) * scale[v, u, 0]
            y = (g - mean[v, u, 1]) * scale[v, u, 1]
            z = (r - mean[v, u, 2]) * scale[v, u, 2]
            label = 0
            if x * x + y * y + z * z > one:
                label = 255
                if is_shadow(b, g, r, mean[v, u, 0], mean[v, u, 1], mean[v, u, 2], rule):
                    label = 127
            labels[v, u] = label


@numba.njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def label_grey(image, mean, scale, rule, labels):  # type: ignore[no-untyped-def]
    """As `label_colour`, everything (h, w); the ratio of brightness alone tells a shadow."""
    one = np.float32(1.0)
    height, width = labels.shape
    for v in range(height):
        for u in range(width):
            value = np.float32(image[v, u])
            x = (value - mean[v, u]) * scale[v, u]
            label = 0
            if x * x > one:
                label = 255
                if rule[0] * mean[v, u] <= value and value <= rule[1] * mean[v, u]:
                    label = 127
            labels[v, u] = label
