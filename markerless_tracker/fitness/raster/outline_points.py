"""Points of the outlines' polygons: along the ends' arcs and inside the sides, then in pixels.

Derivation: docs/outlines-of-cones.md.
"""

import numpy as np

from markerless_tracker.camera.lens import lens
from markerless_tracker.compiled import inlined, kernel
from markerless_tracker.fitness.raster.outline_arrays import (
    LANES,
    MAX_POINTS,
    SIDE_POINTS,
    TINY,
    VECTOR_LANES,
)
from markerless_tracker.fitness.raster.tangents import clockwise

# 2 cos(h / 3) as a linear function of cos h, exact for h = 0 and h = π / 2.
_THIRD_0, _THIRD_1 = np.sqrt(3.0), 2.0 - np.sqrt(3.0)


@inlined
def place_point(cos, sin, at, to, ends, u, v):  # type: ignore[no-untyped-def]
    """Put the image, at focal length 1, of the point at an angle on an end into u and v at `to`."""
    inverse = 1.0 / (ends[at + 2 * LANES] + cos * ends[at + 5 * LANES] + sin * ends[at + 8 * LANES])
    u[to] = (ends[at] + cos * ends[at + 3 * LANES] + sin * ends[at + 6 * LANES]) * inverse
    v[to] = (ends[at + LANES] + cos * ends[at + 4 * LANES] + sin * ends[at + 7 * LANES]) * inverse


@kernel
def place_arc(cones, e, row, ends, flat, arcs, u, v):  # type: ignore[no-untyped-def]
    """Fill the points of end e's arc, from a row on: ends, middle, and thirds of both halves."""
    n = (cones + VECTOR_LANES - 1) // VECTOR_LANES * VECTOR_LANES
    at, row_of_arc, to = 9 * e * LANES, 4 * e * LANES, row * LANES
    for c in range(n):
        ca, sa = arcs[row_of_arc + c], arcs[row_of_arc + LANES + c]
        cb, sb = arcs[row_of_arc + 2 * LANES + c], arcs[row_of_arc + 3 * LANES + c]
        sense = -1.0 if clockwise(6 * e * LANES + c, flat) else 1.0
        # The middle is normal to the chord and along the sum; the longer one is well-conditioned.
        hc, hs = cb - ca, sb - sa
        mc, ms = ca + cb, sa + sb
        across = hc * hc + hs * hs > mc * mc + ms * ms
        flip = 1.0 if (ca * sb - sa * cb) * sense > 0.0 else -1.0
        mc, ms = (sense * hs if across else flip * mc), (-sense * hc if across else flip * ms)
        scale = 1.0 / np.sqrt(mc * mc + ms * ms + TINY)
        mc, ms = mc * scale, ms * scale
        w = _THIRD_0 + _THIRD_1 * (ca * mc + sa * ms)
        place_point(ca, sa, at + c, to + c, ends, u, v)
        pc, ps = w * ca + mc, w * sa + ms
        scale = 1.0 / np.sqrt(pc * pc + ps * ps + TINY)
        place_point(pc * scale, ps * scale, at + c, to + LANES + c, ends, u, v)
        pc, ps = ca + w * mc, sa + w * ms
        scale = 1.0 / np.sqrt(pc * pc + ps * ps + TINY)
        place_point(pc * scale, ps * scale, at + c, to + 2 * LANES + c, ends, u, v)
        place_point(mc, ms, at + c, to + 3 * LANES + c, ends, u, v)
        pc, ps = cb + w * mc, sb + w * ms
        scale = 1.0 / np.sqrt(pc * pc + ps * ps + TINY)
        place_point(pc * scale, ps * scale, at + c, to + 4 * LANES + c, ends, u, v)
        pc, ps = w * cb + mc, w * sb + ms
        scale = 1.0 / np.sqrt(pc * pc + ps * ps + TINY)
        place_point(pc * scale, ps * scale, at + c, to + 5 * LANES + c, ends, u, v)
        place_point(cb, sb, at + c, to + 6 * LANES + c, ends, u, v)


@kernel
def place_side(cones, e, row, ends, arcs, u, v):  # type: ignore[no-untyped-def]
    """Fill the inner points of the side that begins at end e, from a row on."""
    o = 1 - e
    at, to = (4 * e + 2) * LANES, 4 * o * LANES
    for c in range(cones):
        z0 = _depth(e, c, arcs[at + c], arcs[at + LANES + c], ends)
        z1 = _depth(o, c, arcs[to + c], arcs[to + LANES + c], ends)
        begin, end = (row - 1) * LANES + c, ((row + SIDE_POINTS) % MAX_POINTS) * LANES + c
        for i in range(SIDE_POINTS):
            t = (i + 1.0) / (SIDE_POINTS + 1.0)
            w0, w1 = (1.0 - t) * z0, t * z1
            inverse = 1.0 / (w0 + w1)
            u[(row + i) * LANES + c] = (w0 * u[begin] + w1 * u[end]) * inverse
            v[(row + i) * LANES + c] = (w0 * v[begin] + w1 * v[end]) * inverse


@inlined
def _depth(e, c, cos, sin, ends):  # type: ignore[no-untyped-def]
    at = 9 * e * LANES + c
    return ends[at + 2 * LANES] + cos * ends[at + 5 * LANES] + sin * ends[at + 8 * LANES]


@kernel
def to_pixels(cones, count, k, distortion, distorted, u, v):  # type: ignore[no-untyped-def]
    """Convert points at focal length 1 to pixels."""
    n = (cones + VECTOR_LANES - 1) // VECTOR_LANES * VECTOR_LANES
    fx, skew, cx, fy, cy = k[0], k[1], k[2], k[3], k[4]
    for i in range(count):
        if distorted:
            for c in range(n):
                u[i * LANES + c], v[i * LANES + c] = lens(
                    u[i * LANES + c], v[i * LANES + c], distortion
                )
        for c in range(n):
            b = v[i * LANES + c]
            u[i * LANES + c] = fx * u[i * LANES + c] + skew * b + cx
            v[i * LANES + c] = fy * b + cy
