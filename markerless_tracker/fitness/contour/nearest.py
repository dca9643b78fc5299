"""Search of the model's outline point nearest to a pixel; points are sorted into bands of rows.

The points of neighbouring bands lie side by side, so the compiler vectorises the search of them. A
squared distance and the point's place among the sorted ones are one integer, a key: the bits of a
positive double grow with its value, and the place takes the lowest of them.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.compiled import inlined, kernel
from markerless_tracker.fitness.contour.outline_samples import MAX_SAMPLES
from markerless_tracker.geometry import FloatArray

BAND_PX = 8
"""Height of a band of rows, px."""
_BLOCK = 8
"""Points are searched in a multiple of this number, without a remainder."""
_PLACE = np.uint64(MAX_SAMPLES - 1)
_NOT_FACING = np.uint64(0xFFFFFFFFFFFFFFFF)
_COS_60 = 0.5


class Bands(NamedTuple):
    """Outline points of v views, sorted into b bands.

    Attributes:
        start: (v, b + 1) band i holds the sorted points from start[i] to start[i + 1].
        order: (v, s) index of each sorted point in its view.
        points: (v, 4, s + _BLOCK) u, v (px) and the normal of the sorted points, a row each; after
            the last one _BLOCK points infinitely far away.
    """

    start: NDArray[np.int64]
    order: NDArray[np.int64]
    points: FloatArray


def make_bands(views: int, height: int) -> Bands:
    """Allocate the arrays for frames of at most that height."""
    return Bands(
        np.empty((views, height // BAND_PX + 2), dtype=np.int64),
        np.empty((views, MAX_SAMPLES), dtype=np.int64),
        np.empty((views, 4, MAX_SAMPLES + _BLOCK)),
    )


@inlined
def _key(gap_px2):  # type: ignore[no-untyped-def]
    """The key of place 0 at a squared distance."""
    return np.float64(gap_px2).view(np.uint64) & ~_PLACE


@kernel
def sort_into_bands(count, height, pixel, normal, start, order, points):  # type: ignore[no-untyped-def]
    """Sort one view's outline points, pixel and normal (s, 2), into `Bands`.

    Returns:
        The number of bands.
    """
    bands = height // BAND_PX + 1
    for b in range(bands + 1):
        start[b] = 0
    for s in range(count):
        start[int(pixel[s, 1]) // BAND_PX + 1] += 1
    for b in range(bands):
        start[b + 1] += start[b]
    for s in range(count - 1, -1, -1):
        b = int(pixel[s, 1]) // BAND_PX + 1
        start[b] -= 1
        at = start[b]
        order[at] = s
        points[0, at], points[1, at] = pixel[s, 0], pixel[s, 1]
        points[2, at], points[3, at] = normal[s, 0], normal[s, 1]
    # start[b + 1] now holds the start of band b.
    for b in range(bands):
        start[b] = start[b + 1]
    start[bands] = count
    for at in range(count, count + _BLOCK):
        points[0, at], points[1, at], points[2, at], points[3, at] = np.inf, np.inf, 0.0, 0.0
    return bands


@kernel
def _least_key(begin, end, best, u, v, nu, nv, points):  # type: ignore[no-untyped-def]
    """The least of `best` and the keys of sorted points, of at least those from begin to end."""
    us, vs, along, across = points[0], points[1], points[2], points[3]
    first = np.uint64(begin)
    size = np.uint64((end - begin + _BLOCK - 1) // _BLOCK * _BLOCK)
    for at in range(first, first + size):
        du, dv = us[at] - u, vs[at] - v
        key = _key(du * du + dv * dv) | at
        key = key if along[at] * nu + across[at] * nv > _COS_60 else _NOT_FACING
        best = min(best, key)
    return best


@kernel
def nearest_facing(u, v, nu, nv, most_px2, bands, start, order, points):  # type: ignore[no-untyped-def]
    """Index of the nearest outline point whose normal is within 60° of (nu, nv); -1: none.

    Only points at less than a squared distance of `most_px2` are found.

    Args:
        u, v, nu, nv: the pixel and the direction.
        bands: their number.
        start, order, points: one view's part of `Bands`.
    """
    none = _key(most_px2)
    home = min(max(np.int64(v) // BAND_PX, 0), bands - 1)
    above, below = max(home - 1, 0), min(home + 1, bands - 1)
    best = _least_key(start[above], start[below + 1], none, u, v, nu, nv, points)
    while above > 0 or below < bands - 1:
        # Least vertical distance of points in the bands beyond.
        rows = min(v - above * BAND_PX, (below + 1) * BAND_PX - v)
        if rows > 0.0 and _key(rows * rows) >= best:
            break
        if above > 0:
            above -= 1
            best = _least_key(start[above], start[above + 1], best, u, v, nu, nv, points)
        if below < bands - 1:
            below += 1
            best = _least_key(start[below], start[below + 1], best, u, v, nu, nv, points)
    return order[best & _PLACE] if best != none else np.int64(-1)
