"""Several Gaussians per pixel, for scenes that alternate: screens, leaves, flicker."""

from collections.abc import Iterable, Iterator
from itertools import chain

import numpy as np

from markerless_tracker.compiled import kernel
from markerless_tracker.imaging.images import FloatImage, Image

MEDIAN_TO_SD = 1.4826
"""Standard deviation over median absolute deviation, of a normal distribution."""

# Values of one mode differ by at most this many standard deviations of the sensor's noise, or by
# _LEAST_TOLERANCE grey levels if that is more.
_TOLERANCE_SIGMAS = 4.0
_LEAST_TOLERANCE = 12.0
# A mode seen in a smaller fraction of the frames is dropped: it is a passing object.
_LEAST_SHARE = 0.05
_LEAST_FRAMES = 2


@kernel
def add_frame(image, tolerance, count, mean, moment):  # type: ignore[no-untyped-def]
    """Assign every pixel (h, w, c) to its nearest mode within ``tolerance`` in each channel.

    A pixel without such a mode begins a new one, in a free slot or that of a mode seen only once.
    count (k, h, w), mean and moment (k, h, w, c) float32 are updated: Welford's sums.
    """
    modes, height, width, channels = mean.shape
    for v in range(height):
        for u in range(width):
            best = -1
            nearest = tolerance
            for k in range(modes):
                if count[k, v, u] == 0.0:
                    continue
                furthest = np.float32(0.0)
                for c in range(channels):
                    furthest = max(furthest, abs(np.float32(image[v, u, c]) - mean[k, v, u, c]))
                if furthest <= nearest:
                    nearest = furthest
                    best = k
            if best < 0:
                rarest = 0
                for k in range(1, modes):
                    if count[k, v, u] < count[rarest, v, u]:
                        rarest = k
                if count[rarest, v, u] > 1.0:
                    continue
                best = rarest
                count[best, v, u] = 0.0
                for c in range(channels):
                    mean[best, v, u, c] = 0.0
                    moment[best, v, u, c] = 0.0
            count[best, v, u] += np.float32(1.0)
            for c in range(channels):
                value = np.float32(image[v, u, c])
                change = value - mean[best, v, u, c]
                mean[best, v, u, c] += change / count[best, v, u]
                moment[best, v, u, c] += change * (value - mean[best, v, u, c])


def learn_modes(
    frames: Iterable[Image], modes: int
) -> tuple[int, FloatImage, FloatImage, FloatImage]:
    """Cluster each pixel's values over the frames, in one pass, with memory for ``modes`` models.

    Args:
        frames: (h, w, c) uint8, all of one shape, at least one.
        modes: largest number of modes per pixel.

    Returns:
        Number of frames; counts (k, h, w), means (k, h, w, c) and summed squared deviations
        (k, h, w, c), the most frequent mode first; the counts of rare modes are 0.
    """
    first, second, rest = _two_and_rest(frames)
    tolerance = _LEAST_TOLERANCE
    if second is not None:
        change = np.abs(second.astype(np.int16) - first.astype(np.int16))
        tolerance = max(
            tolerance, _TOLERANCE_SIGMAS * MEDIAN_TO_SD / np.sqrt(2.0) * float(np.median(change))
        )
    count = np.zeros((modes, *first.shape[:2]), dtype=np.float32)
    mean = np.zeros((modes, *first.shape), dtype=np.float32)
    moment = np.zeros_like(mean)
    total = 0
    for frame in rest:
        add_frame(frame, np.float32(tolerance), count, mean, moment)
        total += 1
    least = max(float(_LEAST_FRAMES), _LEAST_SHARE * total)
    order = np.argsort(-count, axis=0, kind="stable")
    count = np.take_along_axis(count, order, axis=0)
    mean = np.take_along_axis(mean, order[..., None], axis=0)
    moment = np.take_along_axis(moment, order[..., None], axis=0)
    count[1:][count[1:] < least] = 0.0
    return total, count, mean, moment


def _two_and_rest(frames: Iterable[Image]) -> tuple[Image, Image | None, Iterator[Image]]:
    iterator = iter(frames)
    first = next(iterator)
    second = next(iterator, None)
    seen = [first] if second is None else [first, second]
    return first, second, chain(seen, iterator)
