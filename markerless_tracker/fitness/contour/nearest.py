"""The outline point nearest to a pixel, found through bands of rows."""

import numpy as np

from markerless_tracker.compiled import kernel

BAND_PX = 8
"""Rows of a frame whose outline points are looked through together for the nearest."""


@kernel
def sort_into_bands(count, height, pixel, start, order):  # type: ignore[no-untyped-def]
    """Sort outline points, pixel (s, 2), into bands of BAND_PX rows; returns the number of bands.

    Band b holds the points order[start[b] : start[b + 1]].
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
        order[start[b]] = s
    # Each start has moved down to where its band begins, one place too far to the right.
    for b in range(bands):
        start[b] = start[b + 1]
    start[bands] = count
    return bands


@kernel
def nearest_facing(u, v, nu, nv, bands, pixel, normal, start, order):  # type: ignore[no-untyped-def]
    """The outline point nearest to a pixel among those that face as (nu, nv) does; -1: none."""
    best = np.inf
    nearest = -1
    home = min(max(np.int64(v) // BAND_PX, 0), bands - 1)
    for away in range(bands):
        # No point of a band that is `away` bands off is nearer than this many rows.
        if away > 0:
            rows = min(v - (home - away + 1) * BAND_PX, (home + away) * BAND_PX - v)
            if rows > 0 and rows * rows >= best:
                break
        for turn in range(2 if away > 0 else 1):
            band = home - away if turn == 0 else home + away
            if band < 0 or band >= bands:
                continue
            for i in range(start[band], start[band + 1]):
                s = np.uint64(order[i])
                du, dv = pixel[s, 0] - u, pixel[s, 1] - v
                gap = du * du + dv * dv
                if gap < best and normal[s, 0] * nu + normal[s, 1] * nv > 0.5:
                    best = gap
                    nearest = order[i]
    return nearest
