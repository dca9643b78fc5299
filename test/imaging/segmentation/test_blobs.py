"""Patches by runs against OpenCV's connected components."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from markerless_tracker.imaging.region import Region
from markerless_tracker.imaging.segmentation.blobs import RIGHT, TOP, clear_small, fill_small


def noise(seed: int, height: int, width: int, share: float) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return np.where(rng.random((height, width)) < share, 255, 0).astype(np.uint8)


def cleared(mask: np.ndarray, least: float, connectivity: int) -> np.ndarray:
    _, labels, stats, _ = cv2.connectedComponentsWithStats(mask, connectivity=connectivity)
    keep = stats[:, cv2.CC_STAT_AREA] >= least
    keep[0] = False
    return np.where(keep[labels], 255, 0).astype(np.uint8)


@pytest.mark.parametrize("connectivity", [4, 8])
@given(
    seed=st.integers(0, 2**32 - 1),
    height=st.integers(1, 40),
    width=st.integers(1, 70),
    share=st.floats(0.0, 1.0),
    least=st.integers(0, 60),
)
@settings(max_examples=100, deadline=None)
def test_small_patches_are_cleared(
    connectivity: int, seed: int, height: int, width: int, share: float, least: int
) -> None:
    mask = noise(seed, height, width, share)
    expected = cleared(mask, least, connectivity)
    assert not clear_small(mask, least, connectivity=connectivity)
    np.testing.assert_array_equal(mask, expected)


@given(seed=st.integers(0, 2**32 - 1), share=st.floats(0.3, 1.0), largest=st.integers(0, 40))
@settings(max_examples=50, deadline=None)
def test_small_gaps_inside_are_filled(seed: int, share: float, largest: int) -> None:
    mask = noise(seed, 30, 50, share)
    left, top, width, height = cv2.boundingRect(mask)
    box = np.s_[top : top + height, left : left + width]
    gaps = np.ascontiguousarray(255 - mask[box])
    _, labels, stats, _ = cv2.connectedComponentsWithStats(gaps, connectivity=4)
    expected = mask.copy()
    for k in range(1, len(stats)):
        where = labels == k
        border = where[0].any() or where[-1].any() or where[:, 0].any() or where[:, -1].any()
        if stats[k, cv2.CC_STAT_AREA] < largest and not border:
            expected[box][where] = 255
    assert not fill_small(mask, largest)
    np.testing.assert_array_equal(mask, expected)


def test_a_patch_that_may_continue_outside_is_reported_and_stays() -> None:
    mask = np.zeros((20, 30), np.uint8)
    mask[5:8, 20:30] = 255  # touches the right side
    mask[0:2, 3:5] = 255  # touches the top
    both = mask.copy()
    assert clear_small(mask, 100.0, connectivity=8, unknown=RIGHT | TOP)
    np.testing.assert_array_equal(mask, both)
    # Not reported where it is not needed.
    need = Region(0, 4, 15, 20)
    assert not clear_small(mask, 100.0, connectivity=8, need=need, unknown=RIGHT | TOP)
    np.testing.assert_array_equal(mask, both)
    assert not clear_small(mask, 100.0, connectivity=8)
    assert not mask.any()


def test_nothing_outside_the_zone_is_touched() -> None:
    mask = noise(3, 30, 40, 0.2)
    zone = Region(8, 5, 33, 22)
    expected = mask.copy()
    expected[zone.slices] = cleared(np.ascontiguousarray(mask[zone.slices]), 4, 8)
    clear_small(mask, 4, connectivity=8, zone=zone)
    np.testing.assert_array_equal(mask, expected)
