"""Connected components of masks packed into rows of words, from the runs of their rows.

A silhouette has a few runs a row, so that its components are found in a fraction of the time that
labelling each pixel takes.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.compiled import kernel
from markerless_tracker.fitness.raster.bits import ALL, popcount
from markerless_tracker.geometry import FloatArray
from markerless_tracker.imaging import Region
from markerless_tracker.observation import MaskWords, locked

_ONE, _LAST = np.uint64(1), np.uint64(63)


class Components(NamedTuple):
    """Runs of set pixels, row by row, and the 8-connected component of each.

    Attributes:
        first: (h + 1,) index of the first run of each row, then the number of runs n.
        begin, end: (n,) first column of each run, and the column after its last one.
        number: (n,) its component, numbered from 0 on in the order of their first pixels.
        total: number of components.
    """

    first: NDArray[np.int64]
    begin: NDArray[np.int64]
    end: NDArray[np.int64]
    number: NDArray[np.int64]
    total: int

    @property
    def rows(self) -> NDArray[np.int64]:
        """(n,) row of each run."""
        return np.repeat(np.arange(len(self.first) - 1), np.diff(self.first))

    @property
    def areas_px(self) -> NDArray[np.int64]:
        """(total,) pixels of each component."""
        areas = np.bincount(self.number, self.end - self.begin, self.total)
        return np.asarray(areas, dtype=np.int64)

    @property
    def centres_px(self) -> FloatArray:
        """(total, 2) mean of each component's pixels."""
        length = self.end - self.begin
        columns = length * (self.begin + self.end - 1) / 2.0
        sums = [
            np.bincount(self.number, weights, self.total)
            for weights in (columns, length * self.rows)
        ]
        return np.stack(sums, axis=1) / self.areas_px[:, None]

    def box(self, chosen: NDArray[np.bool_] | None = None) -> Region | None:
        """Bounding box of the chosen components (total,), of all if left out; None without any."""
        begin, end, rows = self.begin, self.end, self.rows
        if chosen is not None:
            runs = chosen[self.number]
            begin, end, rows = begin[runs], end[runs], rows[runs]
        if not len(rows):
            return None
        return Region(int(begin.min()), int(rows[0]), int(end.max()), int(rows[-1]) + 1)


def components(words: MaskWords) -> Components:
    """The 8-connected components of a packed mask (h, k)."""
    # Read-only words and others would be two signatures, each compiled.
    words = locked(words, np.uint64)
    count = int(count_runs(words))
    first = np.empty(len(words) + 1, dtype=np.int64)
    begin, end, parent, number = np.empty((4, count), dtype=np.int64)
    return Components(
        first, begin, end, number, int(find_runs(words, first, begin, end, parent, number))
    )


@kernel
def count_runs(words):  # type: ignore[no-untyped-def]
    """Number of runs of set bits in the rows of a mask (h, k)."""
    count = np.uint64(0)
    for row in words:
        before = np.uint64(0)
        for word in row:
            count += popcount(word & ~((word << _ONE) | before))
            before = word >> _LAST
    return count


@kernel
def find_runs(words, first, begin, end, parent, number):  # type: ignore[no-untyped-def]
    """Fill the runs of a mask (h, k) as in `Components`; returns the number of components.

    Args:
        words: the mask.
        first, begin, end, number: output.
        parent: (n,) working memory: an earlier run of the same component, or the run itself.
    """
    height, width = words.shape
    n = 0
    for v in range(height):
        first[v] = n
        before = np.uint64(0)
        for w in range(width):
            word = words[v, w]
            changes = word ^ ((word << _ONE) | before)
            before = word >> _LAST
            while changes != np.uint64(0):
                lowest = changes & (~changes + _ONE)
                column = (w << 6) + np.int64(popcount(lowest - _ONE))
                if word & lowest != np.uint64(0):
                    begin[n] = column
                    parent[n] = n
                else:
                    end[n] = column
                    n += 1
                changes ^= lowest
        if before != np.uint64(0):
            end[n] = width << 6
            n += 1
        if v > 0:
            _join_rows(first[v - 1], first[v], n, begin, end, parent)
    first[height] = n
    count = 0
    for r in range(n):
        if parent[r] == r:
            number[r] = count
            count += 1
        else:
            number[r] = number[parent[r]]
    return count


@kernel
def _join_rows(a, middle, last, begin, end, parent):  # type: ignore[no-untyped-def]
    """Join the runs a to middle - 1 of a row with those of the next one, up to last - 1."""
    b = middle
    while a < middle and b < last:
        if begin[a] <= end[b] and begin[b] <= end[a]:
            x, y = _root(parent, a), _root(parent, b)
            parent[max(x, y)] = min(x, y)
        if end[a] < end[b]:
            a += 1
        else:
            b += 1


@kernel
def _root(parent, r):  # type: ignore[no-untyped-def]
    while parent[r] != r:
        parent[r] = parent[parent[r]]
        r = parent[r]
    return r


@kernel
def clear_components(parts, kept, words):  # type: ignore[no-untyped-def]
    """Clear the bits of words (h, k) in the runs of components that are not kept; count them.

    Args:
        parts: `Components` of a mask of that size.
        kept: (total,).
        words: changed in place.
    """
    cleared = np.uint64(0)
    for v in range(words.shape[0]):
        for r in range(parts.first[v], parts.first[v + 1]):
            if kept[parts.number[r]]:
                continue
            u, end = parts.begin[r], parts.end[r]
            while u < end:
                w, stop = u >> 6, min(end, ((u >> 6) + 1) << 6)
                bits = (ALL >> np.uint64(64 - (stop - u))) << np.uint64(u & 63)
                cleared += popcount(words[v, w] & bits)
                words[v, w] &= ~bits
                u = stop
    return cleared


@kernel
def touch_components(parts, mask, touched):  # type: ignore[no-untyped-def]
    """Mark the components (total,) that have a pixel in a mask (h, w), 0 or not."""
    for v in range(mask.shape[0]):
        for r in range(parts.first[v], parts.first[v + 1]):
            if touched[parts.number[r]]:
                continue
            for u in range(parts.begin[r], parts.end[r]):
                if mask[v, u] != 0:
                    touched[parts.number[r]] = True
                    break
