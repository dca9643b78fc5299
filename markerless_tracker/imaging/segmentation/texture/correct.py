"""Correction of labels by the light of the windows around each pixel."""

import cv2
import numpy as np
from numpy.typing import NDArray

from markerless_tracker.compiled import kernel
from markerless_tracker.imaging.images import Image
from markerless_tracker.imaging.region import Region
from markerless_tracker.imaging.segmentation.kernels import FOREGROUND, SHADOW
from markerless_tracker.imaging.segmentation.texture.light import (
    CLIPPED,
    SPREAD_PX,
    lit,
    spread_light,
    window_light,
)

# Standard deviations of the noise within which a pixel agrees with a window's light.
_AGREE = 3.5


@kernel
def _mark_candidates(label, examined, light, protect, reveal, marks):  # type: ignore[no-untyped-def]
    """Mark the pixels of a row whose label the light may change: marks (n,) uint8 0 or 1."""
    for j in range(label.size):
        own = label[j]
        hidden = reveal & (light[j] < np.float32(0.0))
        known = (examined[j] != 0) & ((own != SHADOW) | protect)
        marks[j] = hidden if own == 0 else known


@kernel
def apply_light(  # type: ignore[no-untyped-def]
    image, mean, gain, agree, radius, protect, reveal, left, top, light, near_valid, part, corner,
    examined, marks, labels,
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
        marks: a multiple of 8 and at least as many as the part has columns, uint8, 0; overwritten.
        labels: (c, d).
    """
    rows, columns = light.shape
    begin, end = part[0], part[2]
    # Groups of eight pixels whose labels stay are skipped at once.
    words = marks.view(np.uint64)
    for i in range(part[1], part[3]):
        y, x = corner[1] + i, corner[0] + begin
        label = labels[y, x : x + end - begin]
        covers = examined[y, x : x + end - begin]
        _mark_candidates(label, covers, light[i, begin:end], protect, reveal, marks)
        for word in range(words.size):
            if words[word] == 0:
                continue
            for k in range(8 * word, min(8 * word + 8, label.size)):
                if marks[k] == 0:
                    continue
                j = begin + k
                explained = False
                if near_valid[i, j] != 0:
                    value = np.float32(image[i, j])
                    base = mean[top + i, left + j] * gain
                    base = min(base, np.float32(255.0)) if image[i, j] >= CLIPPED else base
                    explained = _explains(light, value, base, agree, radius, i, j)
                if explained:
                    label[k] = label[k] if label[k] == 0 else SHADOW
                elif light[i, j] < 0.0 and protect:
                    label[k] = FOREGROUND


@kernel
def _explains(light, value, base, agree, radius, i, j):  # type: ignore[no-untyped-def]
    """Whether the light of any valid window within the radius of (i, j) explains a pixel."""
    rows, columns = light.shape
    for v in range(max(i - radius, 0), min(i + radius + 1, rows)):
        for u in range(max(j - radius, 0), min(j + radius + 1, columns)):
            p = light[v, u]
            if p > 0.0 and abs(value - p * base) <= agree:
                return True
    return False


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
        found[1], near_valid, part.relative_to(seen), corner, examined,
        np.zeros((part.width + 7) // 8 * 8, dtype=np.uint8), labels,
    )  # fmt: skip
