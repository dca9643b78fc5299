"""Search of the model's outline point nearest to a pixel; points are sorted into bands of rows."""

import numpy as np

from markerless_tracker.compiled import kernel

BAND_PX = 8
"""Height of a band of rows, px."""


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
    # start[b + 1] now holds the start of band b.
    for b in range(bands):
        start[b] = start[b + 1]
    start[bands] = count
    return bands


@kernel
def nearest_facing(u, v, nu, nv, most_px2, bands, pixel, normal, start, order):  # type: ignore[no-untyped-def]
    """Index of the nearest outline point whose normal is within 60° of (nu, nv); -1: none.

    Only points at less than a squared distance of `most_px2` are found.
    """
    best = most_px2
    nearest = -1
    home = min(max(np.int64(v) // BAND_PX, 0), bands - 1)
    for away in range(bands):
        # Least vertical distance of points in the bands that are `away` bands off.
        if away > 0:
            rows = min(v - (home - away + 1) * BAND_PX, (home + away) * BAND_PX - v)
            if rows > 0 and rows * rows >= best:
                break
        for side in range(2 if away > 0 else 1):
            band = home - away if side == 0 else home + away
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
