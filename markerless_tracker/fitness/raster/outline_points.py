"""Points of the outlines' polygons: along the ends' arcs and inside the sides, then in pixels.

Derivation: docs/outlines-of-cones.md.
"""

import numpy as np

from markerless_tracker.camera.lens import distort
from markerless_tracker.compiled import inlined, kernel
from markerless_tracker.fitness.raster.outline_arrays import (
    LANES,
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
def place_arc(cones, ends, flat, arcs, u, v):  # type: ignore[no-untyped-def]
    """Fill the points of one end's arc: ends, middle, and thirds of both halves.

    Each array begins with that end's first row: with an offset that is not known when the loop is
    compiled it would not be vectorised.
    """
    n = (cones + VECTOR_LANES - 1) // VECTOR_LANES * VECTOR_LANES
    for c in range(n):
        ca, sa = arcs[c], arcs[LANES + c]
        cb, sb = arcs[2 * LANES + c], arcs[3 * LANES + c]
        sense = -1.0 if clockwise(c, flat) else 1.0
        # The middle is normal to the chord and along the sum; the longer one is well-conditioned.
        hc, hs = cb - ca, sb - sa
        mc, ms = ca + cb, sa + sb
        across = hc * hc + hs * hs > mc * mc + ms * ms
        flip = 1.0 if (ca * sb - sa * cb) * sense > 0.0 else -1.0
        mc, ms = (sense * hs if across else flip * mc), (-sense * hc if across else flip * ms)
        scale = 1.0 / np.sqrt(mc * mc + ms * ms + TINY)
        mc, ms = mc * scale, ms * scale
        # All four sums have the same length.
        half = ca * mc + sa * ms
        w = _THIRD_0 + _THIRD_1 * half
        short = 1.0 / np.sqrt(1.0 + w * (w + 2.0 * half))
        long = w * short
        place_point(ca, sa, c, c, ends, u, v)
        place_point(long * ca + short * mc, long * sa + short * ms, c, LANES + c, ends, u, v)
        place_point(short * ca + long * mc, short * sa + long * ms, c, 2 * LANES + c, ends, u, v)
        place_point(mc, ms, c, 3 * LANES + c, ends, u, v)
        place_point(short * cb + long * mc, short * sb + long * ms, c, 4 * LANES + c, ends, u, v)
        place_point(long * cb + short * mc, long * sb + short * ms, c, 5 * LANES + c, ends, u, v)
        place_point(cb, sb, c, 6 * LANES + c, ends, u, v)


@kernel
def place_side(  # type: ignore[no-untyped-def]
    cones, ends, arcs, other_ends, other_arcs, u, v, other_u, other_v
):
    """Fill the inner points of the side from one end to the other.

    Args:
        ends, other_ends: from the first row of each end on.
        arcs, other_arcs: from the rows of the angles at which the side touches each end on.
        u, v, other_u, other_v: from the rows of the side's first and last point on. The inner
            points are put into the rows after the first.
    """
    n = (cones + VECTOR_LANES - 1) // VECTOR_LANES * VECTOR_LANES
    for c in range(n):
        z0 = _depth(c, arcs[c], arcs[LANES + c], ends)
        z1 = _depth(c, other_arcs[c], other_arcs[LANES + c], other_ends)
        u0, v0, u1, v1 = u[c], v[c], other_u[c], other_v[c]
        for i in range(1, SIDE_POINTS + 1):
            t = i / (SIDE_POINTS + 1.0)
            w0, w1 = (1.0 - t) * z0, t * z1
            inverse = 1.0 / (w0 + w1)
            u[i * LANES + c] = (w0 * u0 + w1 * u1) * inverse
            v[i * LANES + c] = (w0 * v0 + w1 * v1) * inverse


@inlined
def _depth(c, cos, sin, ends):  # type: ignore[no-untyped-def]
    return ends[2 * LANES + c] + cos * ends[5 * LANES + c] + sin * ends[8 * LANES + c]


@kernel
def to_pixels(cones, count, k, distortion, distorted, u, v):  # type: ignore[no-untyped-def]
    """Convert points at focal length 1 to pixels."""
    n = (cones + VECTOR_LANES - 1) // VECTOR_LANES * VECTOR_LANES
    fx, skew, cx, fy, cy = k[0], k[1], k[2], k[3], k[4]
    for i in range(count):
        if distorted:
            distort(cones, n, u[i * LANES :], v[i * LANES :], distortion)
        for c in range(n):
            b = v[i * LANES + c]
            u[i * LANES + c] = fx * u[i * LANES + c] + skew * b + cx
            v[i * LANES + c] = fy * b + cy
