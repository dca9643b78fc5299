"""Packed masks are cut, grown and flooded as OpenCV does it with plain ones."""

import cv2
import numpy as np
import pytest

from markerless_tracker.fitness.raster.mask_words import (
    cut_words,
    flood,
    grow_rows,
    grow_square,
    has,
    paste_words,
    spread,
    trim,
)
from markerless_tracker.records import pack_mask, unpack_mask

WIDTHS = (1, 63, 64, 65, 200)


def random_mask(width, share=0.02, height=47, seed=0):
    return np.random.default_rng([seed, width]).random((height, width)) < share


def dilated(mask, shape):
    return cv2.dilate(mask.astype(np.uint8), shape) > 0


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("px", (1, 2, 6, 64, 70))
def test_growth_by_a_square(width, px) -> None:
    mask = random_mask(width, 0.003)
    words = pack_mask(mask)
    grow_square(words, px, width)
    expected = dilated(mask, np.ones((2 * px + 1,) * 2, np.uint8))
    np.testing.assert_array_equal(words, pack_mask(expected))


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("radius", (1, 4, 9))
def test_growth_by_a_disc(width, radius) -> None:
    mask = random_mask(width)
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * radius + 1,) * 2)
    words, out = pack_mask(mask), np.zeros((47, (width + 63) // 64), np.uint64)
    grow_rows(words, disc.sum(axis=1).astype(np.int64) // 2, width, out)
    np.testing.assert_array_equal(out, pack_mask(dilated(mask, disc)))


@pytest.mark.parametrize("width", WIDTHS)
def test_spread_takes_the_neighbours_at_the_sides(width) -> None:
    mask = random_mask(width)
    words = pack_mask(mask)
    out = np.array(
        [[spread(words, v, w) for w in range(words.shape[1])] for v in range(47)], np.uint64
    )
    trim(out, width)
    cross = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))
    np.testing.assert_array_equal(out, pack_mask(dilated(mask, cross)))


@pytest.mark.parametrize(
    "box", ((0, 0, 200, 47), (64, 3, 128, 20), (5, 40, 136, 7), (190, 0, 10, 1))
)
def test_a_part_is_cut(box) -> None:
    left, top, width, height = box
    mask = random_mask(200, 0.5)
    out = np.empty((height, (width + 63) // 64), np.uint64)
    cut_words(pack_mask(mask), left, top, width, out)
    part = mask[top : top + height, left : left + width]
    np.testing.assert_array_equal(out, pack_mask(part))
    assert [has(out, u, 0) for u in range(width)] == part[0].tolist()


@pytest.mark.parametrize(
    "box", ((-3, -2, 210, 60), (-70, 5, 90, 10), (150, 40, 120, 30), (5, 1, 9, 9))
)
def test_a_part_that_goes_beyond_the_frame_is_empty_there(box) -> None:
    left, top, width, height = box
    mask = random_mask(200, 0.5)
    out = np.empty((height, (width + 63) // 64), np.uint64)
    paste_words(pack_mask(mask), left, top, width, out)
    wide = np.pad(mask, 100)
    part = wide[100 + top :, 100 + left :][:height, :width]
    np.testing.assert_array_equal(out, pack_mask(part))


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("share", (0.4, 0.6, 0.7))
def test_a_flood_fills_what_is_joined_by_sides(width, share) -> None:
    within = random_mask(width, share, seed=1)
    seeds = random_mask(width, 0.01, seed=2) & within
    words = pack_mask(seeds)
    flood(words, pack_mask(within), np.empty(47, np.bool_))
    labels = cv2.connectedComponents(within.astype(np.uint8), connectivity=4)[1]
    expected = np.isin(labels, labels[seeds]) & within
    np.testing.assert_array_equal(unpack_mask(words, width), expected)
