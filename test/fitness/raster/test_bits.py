"""Bits against NumPy's booleans."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numba import njit

from markerless_tracker.fitness.raster.bits import count_bits, is_set, popcount
from markerless_tracker.records import pack_mask


@njit
def _popcount(word):
    return popcount(word)


@njit
def _is_set(bits, height, u, v):
    return is_set(bits, height, u, v)


@settings(deadline=None)
@given(st.integers(0, 2**64 - 1))
def test_popcount_counts_the_ones_of_a_word(word):
    assert _popcount(np.uint64(word)) == word.bit_count()


@settings(deadline=None)
@given(st.integers(1, 5), st.integers(1, 200), st.integers(0, 2**32 - 1))
def test_bits_read_and_counted_are_those_packed(height, width, seed):
    mask = np.random.default_rng(seed).random((height, width)) < 0.5
    words = pack_mask(mask)
    assert count_bits(words) == mask.sum()
    bits = words.T.ravel()
    read = [[_is_set(bits, height, u, v) for u in range(width)] for v in range(height)]
    np.testing.assert_array_equal(read, mask)
