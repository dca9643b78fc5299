"""The compiled pass over an image: foreground test and shadow test in one, no allocation.

Plain loops that release the interpreter lock, so that cameras can be segmented in threads of the
caller. Not `parallel=True`: numba's own threads must not be entered by two callers at once.
"""

import numba
import numpy as np

from markerless_tracker.imaging.shadow import is_shadow

FOREGROUND = 255
SHADOW = 127


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
