"""The compiled means of patches against OpenCV's box filter."""

import cv2
import numpy as np
import pytest

from markerless_tracker.imaging.segmentation.kernels import LEVELS, WEAK
from markerless_tracker.imaging.segmentation.patches import STEPS, mark_weak, sum_across

LEFT, TOP = 4, 3


def twin(image, levels, gain, labels, *, radius, limit):
    """Labels by whole-image OpenCV and NumPy."""
    rows, columns = labels.shape
    side = (2 * radius + 1, 2 * radius + 1)
    plain = labels == 0
    count = cv2.boxFilter(plain.astype(np.float64), cv2.CV_64F, side, normalize=False)
    least = np.floor(0.5 * side[0] ** 2 * STEPS * limit)
    weak = np.zeros(labels.shape, bool)
    for c in range(image.shape[2]):
        base = levels[c, TOP : TOP + rows, LEFT : LEFT + columns]
        steps = gain[c] * np.float32(STEPS / LEVELS)
        base = np.minimum(steps * base.astype(np.float32), np.float32(255.0 * STEPS))
        plane = STEPS * image[:, :, c].astype(np.float64) - np.floor(base + np.float32(0.5))
        total = cv2.boxFilter(plane * plain, cv2.CV_64F, side, normalize=False)
        weak |= np.abs(total) > np.maximum(STEPS * limit * count, least)
    return np.where(weak & plain, WEAK, labels).astype(np.uint8)


@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize("radius", [1, 2, 3])
@pytest.mark.parametrize("shape", [(60, 45), (61, 7), (3, 30), (2, 2), (1, 1)])
def test_it_is_the_box_filter_of_differences(shape, radius, channels) -> None:
    rng = np.random.default_rng(radius)
    rows, columns = shape
    mean = rng.uniform(0.0, 250.0, (channels, rows + 5, columns + 9))
    levels = np.rint(mean * LEVELS).astype(np.uint16)
    gain = rng.uniform(0.9, 1.1, channels).astype(np.float32)
    base = np.moveaxis(mean[:, TOP : TOP + rows, LEFT : LEFT + columns], 0, 2)
    light = cv2.blur(rng.normal(0.0, 20.0, shape), (9, 9)).reshape(rows, columns, 1)
    image = gain * base + light + rng.normal(0.0, 3.0, base.shape)
    image = np.clip(np.rint(image), 0, 255).astype(np.uint8)
    labels = rng.choice(np.array([0, 0, 0, 0, 127, 255], np.uint8), shape)
    expected = twin(image, levels, gain, labels, radius=radius, limit=2.0)
    planes = np.ascontiguousarray(np.moveaxis(image, 2, 0))
    mark_weak(planes, levels, gain, labels, (LEFT, TOP), radius=radius, limit=2.0, least_share=0.5)
    np.testing.assert_array_equal(labels, expected)
    if rows > 50:
        assert 50 < (labels == WEAK).sum() < 0.7 * labels.size


@pytest.mark.parametrize("side", range(1, 14, 2))
def test_sums_across_a_window(side: int) -> None:
    part = np.random.default_rng(side).integers(-10_000, 10_000, 49 + side).astype(np.int32)
    total = np.empty(50, dtype=np.int32)
    sum_across(part, side, total)
    np.testing.assert_array_equal(
        total, np.lib.stride_tricks.sliding_window_view(part, side).sum(axis=1)
    )
