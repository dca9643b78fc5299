"""Brightness of an image relative to its background, by channel.

Exposure control, flicker and clouds multiply a whole image by a factor. The factor is estimated as
the mode of the ratios of pixels to their background: a person or a shadow gives other ratios, but
in fewer pixels. Bright pixels weigh more, since noise, and what a video's coding shifts, are alike
in grey levels. It depends on this image only.
"""

import math

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.compiled import kernel
from markerless_tracker.imaging.images import Image
from markerless_tracker.observation import locked

# Number of pixels of the sampling grid.
_SAMPLES = 6_000
# Range of the histogram of log ratios: ratios from 1/4 to 4.
_LOG_RANGE = math.log(4.0)
_BINS = 1024
# Width of the mode in bins: about +-5 %.
_WINDOW = 37
# Usable grey levels: darker ones are noise, brighter ones may be clipped.
_DARK, _BRIGHT = 20.0, 250.0
# A mode with a smaller fraction of the samples, or with fewer samples, is not used.
_LEAST_SHARE = 0.2
_LEAST_SAMPLES = 200


@kernel
def _mode(histogram):  # type: ignore[no-untyped-def]
    """Weighted mean ratio in the window of bins with the most samples; 1 if it has too few.

    histogram: (bins, 3) of each bin: number of samples, sum of weights, sum of weighted ratios.
    """
    every = 0.0
    for place in range(_BINS):
        every += histogram[place, 0]
    inside = 0.0
    for place in range(_WINDOW):
        inside += histogram[place, 0]
    most = inside
    first = 0
    equals = 1
    for place in range(1, _BINS - _WINDOW + 1):
        inside += histogram[place + _WINDOW - 1, 0] - histogram[place - 1, 0]
        if inside > most:
            most = inside
            first = place
            equals = 1
        elif inside == most:
            equals += 1
    if most < max(_LEAST_SAMPLES, _LEAST_SHARE * every):
        return 1.0
    # The middle one of equal maxima: a flat maximum then causes no bias.
    inside = most
    place = first
    seen = 1
    while seen <= equals // 2:
        inside += histogram[place + _WINDOW, 0] - histogram[place, 0]
        place += 1
        if inside == most:
            seen += 1
    weight, total = 0.0, 0.0
    for k in range(place, place + _WINDOW):
        weight += histogram[k, 1]
        total += histogram[k, 2]
    return math.exp(total / weight)


@kernel
def modal_ratio(image, where, base_logs, base_weights, value_logs, histograms, gain):  # type: ignore[no-untyped-def]
    """Fill gain (c,) from the pixels where (n, 2) = (v, u) of an image (h, w, c).

    base_logs: (n, c) log of the background at these pixels; value_logs: (256,) log of each grey
    level; NaN if not usable. base_weights: (n, c) inverse variance of a ratio to the background,
    whose error is the same in grey levels. histograms: (bins, c, 3), working memory, all 0. What a
    sample changes is adjacent there: in arrays of their own, a multiple of 4 kB apart, the three
    values would delay each other.
    """
    per_log = _BINS / (2.0 * _LOG_RANGE)
    channels = gain.size
    # The channels of a pixel are adjacent in memory.
    for i in range(where.shape[0]):
        pixel = image[where[i, 0], where[i, 1]]
        for c in range(channels):
            ratio = value_logs[pixel[c]] - base_logs[i, c]
            if abs(ratio) < _LOG_RANGE:  # False for NaN.
                place = min(int((ratio + _LOG_RANGE) * per_log), _BINS - 1)
                weight = base_weights[i, c]
                histograms[place, c, 0] += 1.0
                histograms[place, c, 1] += weight
                histograms[place, c, 2] += weight * ratio
    for c in range(channels):
        gain[c] = _mode(histograms[:, c])


class ExposureMeter:
    """Measures the brightness of images relative to one background.

    Args:
        mean: (h, w, c) float32, the background.
    """

    def __init__(self, mean: NDArray[np.float32]) -> None:
        height, width, channels = mean.shape
        step = max(1, math.isqrt(height * width // _SAMPLES))
        v, u = np.mgrid[step // 2 : height : step, step // 2 : width : step]
        self._where = np.column_stack([v.ravel(), u.ravel()])
        base = mean[v.ravel(), u.ravel()].astype(np.float64)
        self._base_logs, self._base_weights = _logs(base), base**2
        self._value_logs = _logs(np.arange(256.0))
        self._channels = channels

    def gain(self, image: Image) -> NDArray[np.float32]:
        """(c,) float32: relative brightness of an image (h, w, c) uint8; 1 if it has no mode."""
        gain = np.empty(self._channels, dtype=np.float32)
        modal_ratio(
            locked(image, np.uint8), self._where, self._base_logs, self._base_weights,
            self._value_logs, np.zeros((_BINS, self._channels, 3)), gain,
        )  # fmt: skip
        return gain


def _logs(values: NDArray[np.float64]) -> NDArray[np.float64]:
    usable = (values >= _DARK) & (values <= _BRIGHT)
    return np.where(usable, np.log(np.where(usable, values, 1.0)), np.nan)
