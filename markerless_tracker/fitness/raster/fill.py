"""Filling outlines as bit masks (`bits`), counting and clearing them.

Columns of words, and unsigned rows, let the compiler vectorise loops over rows.
"""

import numpy as np

from markerless_tracker.compiled import inlined, kernel
from markerless_tracker.fitness.raster.bits import ALL, popcount
from markerless_tracker.fitness.raster.outline_arrays import BLOCK_ROWS, LANES

_BLOCK = np.uint64(BLOCK_ROWS)


@inlined
def _whole_blocks(rows):  # type: ignore[no-untyped-def]
    """A number of rows, rounded up to blocks."""
    return (rows + _BLOCK - np.uint64(1)) // _BLOCK * _BLOCK


@kernel
def fill_outline(c, count, out, width, height, bits, used):  # type: ignore[no-untyped-def]
    """Set the pixels whose centres lie inside a convex polygon.

    Args:
        c: index of the polygon in `out`.
        count: number of its points.
        out: one thread's `Outlines`, filled by `find_outlines`; its left and right are written.
        width, height: of the frame, px.
        bits: (words * height,) frame.
        used: (words, 2) first and last row with bits in each column of words; extended.
    """
    if not (out.box[c] <= width - 1.0 and out.box[LANES + c] >= 0.0):
        return
    top = np.int64(out.box[2 * LANES + c])
    bottom = np.int64(out.box[3 * LANES + c])
    if top >= bottom:
        return
    left, right = out.left, out.right
    # From its topmost point on the polygon goes down one side and up the other.
    at, closing = np.uint64(c), np.uint64((count - 1) * LANES + c)
    while at != closing and out.first[at] != top:
        at += np.uint64(LANES)
    for _ in range(count):
        before = at
        at = np.uint64(c) if at == closing else at + np.uint64(LANES)
        # Rows in [lower, upper) cross this edge: half-open, so that a vertex counts once per side.
        start, stop = np.uint64(out.first[before]), np.uint64(out.first[at])
        if start != stop:
            slope = out.slope[at]
            u0 = out.u[at] - slope * out.v[at]
            # Whole blocks: what they have too much is filled by the side's next edge, or not read.
            if start < stop:
                for v in range(start + _BLOCK, start + _BLOCK + _whole_blocks(stop - start)):
                    left[v] = u0 + slope * np.int64(v - _BLOCK)
            else:
                begin = start + _BLOCK - _whole_blocks(start - stop)
                for v in range(begin, start + _BLOCK):
                    right[v] = u0 + slope * np.int64(v - _BLOCK)
    edge = width - 1.0
    first = np.int64(max(out.box[c], 0.0)) >> 6
    last = np.int64(min(out.box[LANES + c], edge)) >> 6
    begin, end = np.uint64(top), np.uint64(bottom)
    for w in range(first, last + 1):
        base, offset = np.uint64(w * height), 64.0 * w
        final = min(63.0, edge - offset)
        for v in range(begin, end):
            one, other = left[v + _BLOCK] - offset, right[v + _BLOCK] - offset
            a, b = (one, other) if one < other else (other, one)
            a = a if a > 0.0 else 0.0
            a = a if a < 64.0 else 64.0
            b = b if b < final else final
            b = b if b > -1.0 else -1.0
            low, high = np.int32(np.ceil(a)), np.int32(np.floor(b))
            word = (ALL << np.uint64(low & 63)) & (ALL >> np.uint64((63 - high) & 63))
            bits[base + v] |= word if low <= high else np.uint64(0)
        used[w, 0] = min(used[w, 0], top)
        used[w, 1] = max(used[w, 1], bottom - 1)


@kernel
def clear_used(words, height, used):  # type: ignore[no-untyped-def]
    """Mark all columns of words as empty."""
    for w in range(words):
        used[w, 0], used[w, 1] = height, -1


@kernel
def wipe(words, height, bits, used):  # type: ignore[no-untyped-def]
    """Clear the rows that `used` marks."""
    for w in range(words):
        for v in range(used[w, 0], used[w, 1] + 1):
            bits[w * height + v] = np.uint64(0)


@kernel
def count_and_wipe(words, height, bits, mask, known, start, used):  # type: ignore[no-untyped-def]
    """Number of set bits that the mask has, too, and of set bits that are known; clears the bits.

    mask, known: flat, from `start` on.
    """
    overlap = np.uint64(0)
    projected = np.uint64(0)
    for w in range(words):
        base, there = np.uint64(w * height), np.uint64(start + w * height)
        for v in range(np.uint64(used[w, 0]), np.uint64(used[w, 1] + 1)):
            word = bits[base + v]
            overlap += popcount(word & mask[there + v])
            projected += popcount(word & known[there + v])
            bits[base + v] = np.uint64(0)
    return overlap, projected


@kernel
def count_beside_and_wipe(  # type: ignore[no-untyped-def]
    words, height, bits, mask, known, static, start, used
):
    """As `count_and_wipe`, for the set bits that are not set in `static`, which is flat, too."""
    overlap = np.uint64(0)
    projected = np.uint64(0)
    for w in range(words):
        base, there = np.uint64(w * height), np.uint64(start + w * height)
        for v in range(np.uint64(used[w, 0]), np.uint64(used[w, 1] + 1)):
            word = bits[base + v] & ~static[there + v]
            overlap += popcount(word & mask[there + v])
            projected += popcount(word & known[there + v])
            bits[base + v] = np.uint64(0)
    return overlap, projected
