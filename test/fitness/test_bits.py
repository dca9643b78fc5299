"""Rows of bits against NumPy's booleans."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numba import njit

from markerless_tracker.fitness.bits import count_bits, is_set, popcount, set_span
from markerless_tracker.records import pack_mask, unpack_mask


@njit
def _popcount(word):
    return popcount(word)


@njit
def _set_span(row, low, high):
    set_span(row, low, high)


@njit
def _is_set(rows, u, v):
    return is_set(rows, u, v)


@given(st.integers(0, 2**64 - 1))
def test_popcount_counts_the_ones_of_a_word(word):
    assert _popcount(np.uint64(word)) == word.bit_count()


@given(st.integers(1, 300), st.data())
def test_spans_set_exactly_their_bits(width, data):
    words = np.zeros((1, (width + 63) // 64), dtype=np.uint64)
    expected = np.zeros((1, width), dtype=bool)
    for _ in range(data.draw(st.integers(1, 4))):
        low = data.draw(st.integers(0, width - 1))
        high = data.draw(st.integers(low, width - 1))
        _set_span(words[0], low, high)
        expected[0, low : high + 1] = True
    np.testing.assert_array_equal(words, pack_mask(expected))


def test_spans_at_every_word_boundary():
    for low in (0, 1, 62, 63, 64, 65, 127, 128):
        for high in (63, 64, 65, 126, 127, 128, 191):
            if low <= high:
                row = np.zeros(3, dtype=np.uint64)
                _set_span(row, low, high)
                mask = unpack_mask(row[None], 192)[0]
                np.testing.assert_array_equal(np.flatnonzero(mask), np.arange(low, high + 1))


@given(st.integers(1, 5), st.integers(1, 200), st.integers(0, 2**32 - 1))
def test_bits_read_and_counted_are_those_packed(height, width, seed):
    mask = np.random.default_rng(seed).random((height, width)) < 0.5
    words = pack_mask(mask)
    assert count_bits(words) == mask.sum()
    read = [[_is_set(words, u, v) for u in range(width)] for v in range(height)]
    np.testing.assert_array_equal(read, mask)
