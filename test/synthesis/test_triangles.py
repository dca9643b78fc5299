"""Parts of the loops that draw triangles, against NumPy."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from markerless_tracker.synthesis.triangles import doubled_area, range_of, weights_at

AT = st.floats(-50.0, 50.0)


@given(st.lists(AT, min_size=6, max_size=6))
def test_the_area_is_that_of_the_determinant(numbers) -> None:
    a, b, c = np.reshape(numbers, (3, 2))
    expected = np.linalg.det(np.stack([b - a, c - a]))
    assert doubled_area(*a, *b, *c) == pytest.approx(expected, abs=1e-9)


def test_a_corner_without_place_has_no_area() -> None:
    assert np.isnan(doubled_area(0.0, 0.0, np.nan, 1.0, 1.0, 0.0))


@given(AT, AT, AT, st.integers(1, 40))
def test_the_range_holds_the_whole_numbers_between_the_corners(a, b, c, size) -> None:
    first, end = range_of(a, b, c, size)
    inside = [n for n in range(size) if min(a, b, c) <= n <= max(a, b, c)]
    assert list(range(first, end)) == inside


@given(st.integers(0, 2**32 - 1))
def test_the_weights_give_the_place(seed) -> None:
    rng = np.random.default_rng(seed)
    a, b, c, at = rng.uniform(-10.0, 10.0, (4, 2))
    area = doubled_area(*a, *b, *c)
    if abs(area) > 1e-2:
        wb, wc = weights_at(*at, *a, *b, *c, area)
        np.testing.assert_allclose((1.0 - wb - wc) * a + wb * b + wc * c, at, atol=1e-6)
