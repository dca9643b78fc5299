"""Bit masks: a word holds 64 neighbouring pixels of a row, the first in the lowest bit.

Word w of row v of a frame lies at w * height + v: column after column of words.
"""

from typing import Any

import numpy as np
from numba import types
from numba.extending import intrinsic

from markerless_tracker.compiled import inlined, kernel

ALL = np.uint64(0xFFFFFFFFFFFFFFFF)
"""A word with all bits set."""


@intrinsic  # type: ignore[misc]
def popcount(typingctx: Any, word: Any) -> Any:
    """Number of set bits of a uint64."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.ctpop(args[0])

    return types.uint64(types.uint64), codegen


@inlined
def is_set(bits, height, u, v):  # type: ignore[no-untyped-def]
    """Whether the bit of column u in row v is set; both must lie inside the frame."""
    word = bits[np.uint64((u >> 6) * height + v)]
    return (word >> np.uint64(u & 63)) & np.uint64(1) != np.uint64(0)


@kernel
def count_bits(rows):  # type: ignore[no-untyped-def]
    """Number of set bits of rows (h, w) of words."""
    total = np.uint64(0)
    for row in rows:
        for word in row:
            total += popcount(word)
    return total
