"""Signed distances against two distance transforms of OpenCV, and against exact distances."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from markerless_tracker.fitness.contour.signed_distance import signed_distance

FAR_PX = 5000.0


def twin(mask: np.ndarray) -> np.ndarray:
    outward = cv2.distanceTransform(1 - mask, cv2.DIST_L2, 5)
    inward = cv2.distanceTransform(mask, cv2.DIST_L2, 5)
    return outward - inward + mask - 0.5


@given(st.integers(0, 10_000), st.integers(1, 70), st.integers(1, 70), st.floats(0.001, 0.999))
@settings(max_examples=150, deadline=None)
def test_of_random_masks_they_are_those_of_opencv(seed, rows, columns, share) -> None:
    mask = (np.random.default_rng(seed).random((rows, columns)) < share).astype(np.uint8)
    found = signed_distance(mask)
    assert found.dtype == np.float32 and found.shape == mask.shape
    if mask.any() and not mask.all():
        np.testing.assert_allclose(found, twin(mask), atol=2e-3)
    else:
        assert (np.abs(found) > FAR_PX).all() and (found < 0).all() == bool(mask.all())


@pytest.mark.parametrize("size", [(240, 320), (77, 131), (3, 400), (400, 2)])
def test_of_a_shape_they_are_exact_to_two_percent(size) -> None:
    mask = np.zeros(size, np.uint8)
    centre = (size[1] // 2, size[0] // 2)
    cv2.ellipse(mask, centre, (size[1] // 4, size[0] // 3), 20, 0, 360, 1, -1)
    found = signed_distance(mask)
    np.testing.assert_allclose(found, twin(mask), atol=2e-3)
    exact = cv2.distanceTransform(1 - mask, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    outside = mask == 0
    np.testing.assert_allclose(found[outside] + 0.5, exact[outside], rtol=0.025, atol=1e-3)


def test_the_mask_may_be_read_only_and_stays_as_it_is() -> None:
    mask = np.zeros((20, 30), np.uint8)
    mask[5:9, 7:20] = 1
    before = mask.copy()
    mask.flags.writeable = False
    np.testing.assert_allclose(signed_distance(mask), twin(before), atol=2e-3)
    np.testing.assert_array_equal(mask, before)
