"""What a patch's texture tells about it: a shadow keeps the floor's pattern, a body hides it.

Brightness alone cannot tell a hard shadow from dark trousers, nor grey clothes from a grey wall as
bright as they are. In a small window, image I and background B are compared by
e^2 = var(I - p B) with p = mean(I) / mean(B): that of the sensor's noise where the window shows
the background in any light, and larger by p^2 var(B) where something covers it. A window says
something only where p^2 var(B), the pattern, stands out from the noise.
"""

import numba
import numpy as np
from numpy.typing import NDArray

from markerless_tracker.imaging.images import Image

# The pattern's variance, in those of the noise, from which on a window can show that the pattern is
# there, and from which on that it is hidden.
SURE, TOLD = 6.0, 6.0
# What is left of the pattern's variance after it is taken away: less is the same, more is other.
SAME, OTHER = 0.15, 0.85
# Windows without a pattern: this plus their light.
UNKNOWN = 100.0
# Change of light from one pixel to the next that may be the same shadow.
STEP = 0.006
# Deviations of the noise within which a pixel agrees with a window's light.
_AGREE = 3.5


@numba.njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def window_light(image, mean, gain, noise, radius, top, left, light):  # type: ignore[no-untyped-def]
    """Light of windows on a part of a grey image: p > 0 where they show the background in light p.

    image (h, w) uint8; mean (h, w) float32; gain, noise (variance) of the image; light (a, b)
    float32 is filled for the part that begins at (top, left): p; -1 where something else covers
    the background; UNKNOWN + p where there is no pattern; 0 where the window says nothing.
    """
    height, width = image.shape
    rows, columns = light.shape
    # Sums of whole numbers: the same whatever the order.
    sums = np.zeros((5, width), dtype=np.int64)
    first_u = max(left - radius, 0)
    end_u = min(left + columns + radius, width)
    low = 0
    high = 0
    for i in range(rows):
        v = top + i
        next_low = max(v - radius, 0)
        next_high = min(v + radius + 1, height)
        if i == 0:
            low = next_low
            high = next_low
        while high < next_high:
            for u in range(first_u, end_u):
                a = np.int64(image[high, u])
                b = np.int64(mean[high, u] * gain + np.float32(0.5))
                sums[0, u] += a
                sums[1, u] += b
                sums[2, u] += a * a
                sums[3, u] += a * b
                sums[4, u] += b * b
            high += 1
        while low < next_low:
            for u in range(first_u, end_u):
                a = np.int64(image[low, u])
                b = np.int64(mean[low, u] * gain + np.float32(0.5))
                sums[0, u] -= a
                sums[1, u] -= b
                sums[2, u] -= a * a
                sums[3, u] -= a * b
                sums[4, u] -= b * b
            low += 1
        a_sum = b_sum = aa = ab = bb = np.int64(0)
        start = first_u
        stop = first_u
        for j in range(columns):
            u = left + j
            next_start = max(u - radius, 0)
            next_stop = min(u + radius + 1, width)
            while stop < next_stop:
                a_sum += sums[0, stop]
                b_sum += sums[1, stop]
                aa += sums[2, stop]
                ab += sums[3, stop]
                bb += sums[4, stop]
                stop += 1
            while start < next_start:
                a_sum -= sums[0, start]
                b_sum -= sums[1, start]
                aa -= sums[2, start]
                ab -= sums[3, start]
                bb -= sums[4, start]
                start += 1
            light[i, j] = 0.0
            if a_sum <= 0 or b_sum <= 0:
                continue
            n = float((high - low) * (stop - start))
            p = a_sum / b_sum
            var_b = bb / n - (b_sum / n) ** 2
            pattern = p * p * var_b
            var_a = aa / n - (a_sum / n) ** 2
            cov = ab / n - a_sum / n * (b_sum / n)
            rest = var_a - 2.0 * p * cov + pattern - noise
            if pattern >= SURE * noise and rest < SAME * pattern:
                light[i, j] = p
            elif pattern >= TOLD * noise and rest > OTHER * pattern:
                light[i, j] = -1.0
            elif rest < noise:
                light[i, j] = UNKNOWN + p


@numba.njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def spread_light(light):  # type: ignore[no-untyped-def]
    """Let plain windows take part in the light next to them if theirs is the same; in place."""
    rows, columns = light.shape
    for turn in range(4):
        forward = turn % 2 == 0
        for i in range(rows):
            y = i if forward else rows - 1 - i
            near_y = y - 1 if forward else y + 1
            for j in range(columns):
                x = j if forward else columns - 1 - j
                if light[y, x] < UNKNOWN:
                    continue
                p = light[y, x] - UNKNOWN
                near_x = x - 1 if forward else x + 1
                if 0 <= near_y < rows:
                    q = light[near_y, x]
                    if q > 0.0 and q < UNKNOWN and abs(p - q) <= STEP:
                        light[y, x] = p
                        continue
                if 0 <= near_x < columns:
                    q = light[y, near_x]
                    if q > 0.0 and q < UNKNOWN and abs(p - q) <= STEP:
                        light[y, x] = p


@numba.njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def apply_light(  # type: ignore[no-untyped-def]
    image, mean, gain, agree, radius, least, most, protect, reveal, top, left, light, labels
):
    """Correct labels (h, w) by the light (a, b) of the windows around each pixel, in place.

    A pixel that agrees with the light, from ``least`` to ``most``, of any window that holds it is
    background, or shadow if it was not background before. Else, if its own window is covered, with
    ``protect`` shadow becomes foreground, and with ``reveal`` background too.
    """
    rows, columns = light.shape
    for i in range(rows):
        for j in range(columns):
            v = top + i
            u = left + j
            label = labels[v, u]
            own = light[i, j]
            if label == 0 and (not reveal or own >= 0.0):
                continue
            value = np.float32(image[v, u])
            base = mean[v, u] * gain
            explained = False
            for di in range(-radius, radius + 1):
                y = i + di
                if y < 0 or y >= rows or explained:
                    continue
                for dj in range(-radius, radius + 1):
                    x = j + dj
                    if x < 0 or x >= columns:
                        continue
                    p = light[y, x]
                    if p >= least and p <= most and abs(value - p * base) <= agree:
                        explained = True
                        break
            if explained:
                if label != 0:
                    labels[v, u] = 127
            elif own < 0.0 and protect:
                labels[v, u] = 255


def correct_labels(
    image: Image,
    mean: NDArray[np.float32],
    gain: float,
    sigma: float,
    labels: NDArray[np.uint8],
    region: tuple[int, int, int, int],
    *,
    radius: int,
    light: tuple[float, float],
    protect: bool,
    reveal: bool,
) -> None:
    """Correct labels (h, w) of `kernels` by texture, in place.

    Args:
        image: (h, w) grey.
        mean: (h, w) grey background.
        gain: brightness of the image relative to the background's.
        sigma: the sensor's noise, grey levels.
        labels: 0 background, 127 shadow, 255 foreground.
        region: (left, top, width, height) to look at.
        radius: of the windows, px.
        light: least and largest light of a shadow.
        protect: whether shadow may become foreground.
        reveal: whether background may become foreground.
    """
    left, top, width, height = region
    if width == 0 or height == 0:
        return
    found = np.empty((height, width), dtype=np.float32)
    one = np.float32(gain)
    window_light(image, mean, one, float(sigma) ** 2, radius, top, left, found)
    spread_light(found)
    apply_light(
        image, mean, one, np.float32(_AGREE * sigma), radius,
        np.float32(light[0]), np.float32(light[1]), protect, reveal, top, left, found, labels,
    )  # fmt: skip
