"""How much brighter an image is than the background it is compared with, by channel.

Exposure control, flicker and clouds multiply a whole image. The factor is the value that the ratios
of pixels to their background crowd around: a person or a shadow gives other ratios, but none that
so many pixels share. It is found anew in every image and remembers nothing.
"""

import math

import numba
import numpy as np
from numpy.typing import NDArray

from markerless_tracker.imaging.images import Image

# Pixels looked at; a grid over the image.
_SAMPLES = 6_000
# Ratios are counted in bins of their logarithm, from 1/4 to 4.
_REACH = math.log(4.0)
_BINS = 1024
# Width of the crowd in bins: about +-5 %.
_CROWD = 37
# Darker pixels are noise, brighter ones may be clipped.
_DARK, _BRIGHT = 20.0, 250.0
# A crowd with less than this share of the samples, or with fewer samples, says nothing.
_LEAST_SHARE = 0.2
_LEAST_SAMPLES = 200


@numba.njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def count_ratios(image, mean, step, first_bin, per_log, counts, sums):  # type: ignore[no-untyped-def]
    """Count log(image / mean) of (h, w, c) on a grid; counts and sums (of the logs): (c, bins)."""
    height, width, channels = mean.shape
    bins = counts.shape[1]
    for v in range(step // 2, height, step):
        for u in range(step // 2, width, step):
            for c in range(channels):
                value = np.float32(image[v, u, c])
                base = mean[v, u, c]
                if value < _DARK or value > _BRIGHT or base < _DARK or base > _BRIGHT:
                    continue
                ratio = math.log(value / base)
                place = int(math.floor((ratio - first_bin) * per_log))
                if 0 <= place < bins:
                    counts[c, place] += 1
                    sums[c, place] += ratio


def exposure_gain(image: Image, mean: NDArray[np.float32]) -> NDArray[np.float32]:
    """Brightness of the image relative to the background's, (c,) float32; 1 where it cannot tell.

    Args:
        image: (h, w, c) uint8.
        mean: (h, w, c) float32, the background.
    """
    height, width, channels = mean.shape
    counts = np.zeros((channels, _BINS), dtype=np.int64)
    sums = np.zeros((channels, _BINS), dtype=np.float64)
    step = max(1, math.isqrt(height * width // _SAMPLES))
    count_ratios(image, mean, step, -_REACH, _BINS / (2.0 * _REACH), counts, sums)
    gain = np.ones(channels, dtype=np.float32)
    for c in range(channels):
        before = np.concatenate([[0], np.cumsum(counts[c])])
        crowd = before[_CROWD:] - before[:-_CROWD]
        # Of equal crowds the middle one: a flat top has no bias then.
        best = np.flatnonzero(crowd == crowd.max())
        first = int(best[len(best) // 2])
        inside = int(crowd[first])
        if inside < max(_LEAST_SAMPLES, _LEAST_SHARE * int(before[-1])):
            continue
        gain[c] = math.exp(sums[c, first : first + _CROWD].sum() / inside)
    return gain
