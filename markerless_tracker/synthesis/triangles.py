"""Parts of the loops that draw triangles."""

import numpy as np

from markerless_tracker.compiled import inlined


@inlined
def doubled_area(ax, ay, bx, by, cx, cy):  # type: ignore[no-untyped-def]
    """Twice the signed area of a triangle; NaN if a corner is."""
    return (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)


@inlined
def range_of(a, b, c, size):  # type: ignore[no-untyped-def]
    """First column (or row) of a triangle and the one after the last, of `size` ones."""
    first = max(0, int(np.ceil(max(min(a, b, c), -1.0))))
    last = min(size - 1, int(np.floor(min(max(a, b, c), float(size)))))
    return first, last + 1


@inlined
def weights_at(u, v, ax, ay, bx, by, cx, cy, area):  # type: ignore[no-untyped-def]
    """Weights of the corners b and c at (u, v), where those of a, b and c add up to 1."""
    wb = ((u - ax) * (cy - ay) - (v - ay) * (cx - ax)) / area
    wc = ((bx - ax) * (v - ay) - (by - ay) * (u - ax)) / area
    return wb, wc
