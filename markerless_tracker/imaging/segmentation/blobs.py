"""Removal of small connected patches of a mask, also of patches that may continue outside of it.

Patches are built from the runs of each row, since a silhouette has few runs.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from markerless_tracker.compiled import compiled, kernel
from markerless_tracker.imaging.region import Region

LEFT, TOP, RIGHT, BOTTOM = 1, 2, 4, 8
"""Sides of a rectangle, as bits of a set."""
EVERY = LEFT | TOP | RIGHT | BOTTOM


@kernel
def _root(parent, i):  # type: ignore[no-untyped-def]
    while parent[i] != i:
        parent[i] = parent[parent[i]]
        i = parent[i]
    return i


@kernel
def _count_runs(mask, part, target):  # type: ignore[no-untyped-def]
    """Runs of ``target`` in a part (left, top, right, bottom) of a mask."""
    count = 0
    for v in range(part[1], part[3]):
        row = mask[v, part[0] : part[2]]
        before = row[: row.size - 1]
        after = row[1:]
        count += row[0] == target
        for u in range(after.size):
            count += (after[u] == target) & (before[u] != target)
    return count


@kernel
def _same_until(values, words, u, value):  # type: ignore[no-untyped-def]
    """First index from u on whose value differs from ``value`` (0 or 255); eight at a time."""
    n = values.size
    whole = np.uint64(0) if value == 0 else np.uint64(0xFFFFFFFFFFFFFFFF)
    while u < n:
        if u & 7 == 0 and words[u >> 3] == whole:
            u += 8
            continue
        if values[u] != value:
            return u
        u += 1
    return n


@kernel
def _join_runs(mask, part, target, touch, values, begin, end, parent, first):  # type: ignore[no-untyped-def]
    """Fill the runs of ``target`` and join those that belong to one patch.

    Args:
        mask, part, target: as for `flip_small`.
        touch: 1 if runs of neighbouring rows also join at corners, else 0.
        values: a row of the part, padded to a multiple of 8 with the other value, so that every run
            ends before or at the padding; written.
        begin, end: (n,) first column of each run, and the column after its last one; written.
        parent: (n,) union-find forest of the runs, one tree a patch; written.
        first: (rows + 1,) index of each row's first run; written.
    """
    rows, columns = part[3] - part[1], part[2] - part[0]
    n = 0
    words = values.view(np.uint64)
    for i in range(rows):
        first[i] = n
        row = mask[part[1] + i, part[0] : part[2]]
        # An assignment of slices would take a second to compile, for the text of its error.
        for u in range(columns):
            values[u] = row[u]
        u = _same_until(values, words, 0, 255 - target)
        while u < columns:
            begin[n] = part[0] + u
            u = _same_until(values, words, u, target)
            end[n] = part[0] + min(u, columns)
            parent[n] = n
            n += 1
            u = _same_until(values, words, u, 255 - target)
        if i == 0:
            continue
        a = first[i - 1]
        b = first[i]
        while a < first[i] and b < n:
            if begin[a] < end[b] + touch and begin[b] < end[a] + touch:
                x = _root(parent, a)
                y = _root(parent, b)
                parent[max(x, y)] = min(x, y)
            if end[a] < end[b]:
                a += 1
            else:
                b += 1
    first[rows] = n


@kernel
def _measure_patches(part, need, begin, end, parent, first, area, sides, needed):  # type: ignore[no-untyped-def]
    """Sum area and sides of each patch at its root run.

    Args:
        part, need: as for `flip_small`.
        begin, end, parent, first: of `_join_runs`.
        area: (n,) 0; becomes the number of pixels.
        sides: (n,) 0; becomes the sides of the part that the patch touches.
        needed: (n,) False; becomes whether a pixel of the patch is in ``need``.
    """
    rows = first.size - 1
    for i in range(rows):
        v = part[1] + i
        side = 0
        if i == 0:
            side |= TOP
        if i == rows - 1:
            side |= BOTTOM
        inside = need[1] <= v and v < need[3]
        for r in range(first[i], first[i + 1]):
            root = _root(parent, r)
            area[root] += end[r] - begin[r]
            sides[root] |= side
            if begin[r] == part[0]:
                sides[root] |= LEFT
            if end[r] == part[2]:
                sides[root] |= RIGHT
            if inside and begin[r] < need[2] and end[r] > need[0]:
                needed[root] = True


@compiled()
def flip_small(mask, part, need, target, least, connectivity, spared, unknown):  # type: ignore[no-untyped-def]
    """Turn patches of ``target`` with fewer than ``least`` pixels into 255 - target, in place.

    Args:
        mask: (h, w) uint8, 0 or 255.
        part: (left, top, right, bottom) that is searched.
        need: (left, top, right, bottom) where the result is needed.
        target: 0 or 255.
        least: least number of pixels of a patch that is kept.
        connectivity: 4 or 8.
        spared: sides of the part; patches that touch them are kept.
        unknown: sides of the part beyond which patches may continue.

    Returns:
        Whether the size of a patch in ``need`` is unknown, since it may continue outside the part;
        such a patch is kept.
    """
    count = _count_runs(mask, part, target)
    begin = np.empty(count, dtype=np.int32)
    end = np.empty(count, dtype=np.int32)
    parent = np.empty(count, dtype=np.int32)
    rows, columns = part[3] - part[1], part[2] - part[0]
    first = np.empty(rows + 1, dtype=np.int32)
    values = np.full((columns + 7) // 8 * 8, 255 - target, dtype=np.uint8)
    touch = 1 if connectivity == 8 else 0
    _join_runs(mask, part, target, touch, values, begin, end, parent, first)
    area = np.zeros(count, dtype=np.int64)
    sides = np.zeros(count, dtype=np.uint8)
    needed = np.zeros(count, dtype=np.bool_)
    _measure_patches(part, need, begin, end, parent, first, area, sides, needed)
    open_question = False
    other = np.uint8(255 - target)
    for i in range(rows):
        for r in range(first[i], first[i + 1]):
            root = _root(parent, r)
            if area[root] >= least or sides[root] & spared:
                continue
            if sides[root] & unknown:
                open_question = open_question or needed[root]
                continue
            for u in range(begin[r], end[r]):
                mask[part[1] + i, u] = other
    return open_question


def clear_small(
    mask: NDArray[np.uint8],
    least_px: float,
    *,
    connectivity: int,
    zone: Region | None = None,
    need: Region | None = None,
    unknown: int = 0,
) -> bool:
    """Clear patches of fewer than ``least_px`` pixels, in place.

    Args:
        mask: (h, w) uint8, 0 or 255, C-contiguous.
        least_px: least size of a patch that is kept.
        connectivity: 4 or 8.
        zone: part of the mask that is searched; None = the whole mask.
        need: where the result is needed; None = the whole zone.
        unknown: sides of the zone beyond which patches may continue.

    Returns:
        Whether the size of a needed patch is unknown; such a patch is kept.
    """
    zone = zone or Region(0, 0, mask.shape[1], mask.shape[0])
    part = occupied(mask, zone)
    if part.width <= 0:
        return False
    return bool(
        flip_small(
            mask, part, need or zone, np.uint8(255), float(least_px), connectivity, 0,
            unknown & _shared_sides(zone, part),
        )
    )  # fmt: skip


def fill_small(
    mask: NDArray[np.uint8],
    largest_px: float,
    *,
    zone: Region | None = None,
    need: Region | None = None,
    unknown: int = 0,
) -> bool:
    """Set 4-connected gaps of fewer than ``largest_px`` pixels, in place; see `clear_small`.

    A gap that reaches the border of the mask's bounding box is no hole.
    """
    zone = zone or Region(0, 0, mask.shape[1], mask.shape[0])
    part = occupied(mask, zone)
    if part.width <= 0:
        return False
    unknown &= _shared_sides(zone, part)
    return bool(
        flip_small(
            mask, part, need or zone, np.uint8(0), float(largest_px), 4, EVERY & ~unknown, unknown
        )
    )


def occupied(mask: NDArray[np.uint8], zone: Region) -> Region:
    """Bounding box of the set pixels in a zone of the mask; of width 0 if there are none."""
    left, top, width, height = cv2.boundingRect(mask[zone.slices])
    return Region(left, top, left + width, top + height).moved(zone.left, zone.top)


def _shared_sides(zone: Region, part: Region) -> int:
    return (
        LEFT * (part.left == zone.left)
        | TOP * (part.top == zone.top)
        | RIGHT * (part.right == zone.right)
        | BOTTOM * (part.bottom == zone.bottom)
    )
