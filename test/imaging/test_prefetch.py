"""Requests of rows: they change nothing, and are in the compiled code."""

import numpy as np
import pytest
from numba import njit

from markerless_tracker.compiled import kernel
from markerless_tracker.imaging.prefetch import prefetch


@kernel
def request(row):  # type: ignore[no-untyped-def]
    prefetch(row)


@pytest.mark.parametrize("size", [0, 1, 31, 32, 200])
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32, np.float64])
def test_a_row_of_any_size_stays_as_it_is(size: int, dtype: type) -> None:
    row = np.arange(size).astype(dtype)
    request(row)
    np.testing.assert_array_equal(row, np.arange(size).astype(dtype))


def test_the_request_is_in_the_code() -> None:
    # What is stored on disk has no LLVM code any more.
    compiled_now = njit(request.py_func)
    compiled_now(np.zeros(8))
    (code,) = compiled_now.inspect_llvm().values()
    assert "call void @llvm.prefetch" in code
