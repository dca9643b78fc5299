"""Rows of bits: 64 pixels a word, least significant first (as `records.pack_mask`)."""

from typing import Any

import numpy as np
from numba import njit, types
from numba.extending import intrinsic

ALL = np.uint64(0xFFFFFFFFFFFFFFFF)


@intrinsic  # type: ignore[misc]
def popcount(typingctx: Any, word: Any) -> Any:
    """Number of set bits of a uint64."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.ctpop(args[0])

    return types.uint64(types.uint64), codegen


@njit(cache=True, nogil=True, inline="always")  # type: ignore[misc]
def set_span(row, low, high):  # type: ignore[no-untyped-def]
    """Set bits low .. high (inclusive, 0 <= low <= high) of a row of words."""
    first = np.uint64(low >> 6)
    last = np.uint64(high >> 6)
    head = ALL << np.uint64(low & 63)
    tail = ALL >> np.uint64(63 - (high & 63))
    if first == last:
        row[first] |= head & tail
        return
    row[first] |= head
    for k in range(first + np.uint64(1), last):
        row[np.uint64(k)] = ALL
    row[last] |= tail


@njit(cache=True, nogil=True, inline="always")  # type: ignore[misc]
def is_set(rows, u, v):  # type: ignore[no-untyped-def]
    """Whether the bit of column u in row v is set; both must lie inside."""
    word = rows[np.uint64(v), np.uint64(u >> 6)]
    return (word >> np.uint64(u & 63)) & np.uint64(1) != np.uint64(0)


@njit(cache=True, nogil=True)  # type: ignore[misc]
def count_bits(rows):  # type: ignore[no-untyped-def]
    """Number of set bits of rows (h, w) of words."""
    total = np.uint64(0)
    for row in rows:
        for word in row:
            total += popcount(word)
    return total
