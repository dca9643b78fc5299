"""Outline of one projected cone: the convex hull of its two projected end ellipses.

An outline is a closed polygon: up one side, around the far end, down the other side, around the
near end. Sides touch the end ellipses at their common tangents; ends are sampled.
"""

import numpy as np
from numba import njit

ARC_POINTS = 7
"""Points of an end's arc between the two tangents, both included."""
SIDE_SEGMENTS = 3
"""Segments of a side seen through a distorting lens; one otherwise."""
MAX_POINTS = 2 * ARC_POINTS + 2 * SIDE_SEGMENTS
NEAR_M = 0.1
"""Cones that come nearer to a camera's plane than this are not drawn in it."""


@njit(cache=True, nogil=True)  # type: ignore[misc]
def project_point(x, y, z, k, distortion, distorted, out):  # type: ignore[no-untyped-def]
    """Pixel (u, v) of a point of the camera's frame in front of it, into out (2,)."""
    a = x / z
    b = y / z
    if distorted:
        k1, k2, k3 = distortion[0], distortion[1], distortion[4]
        p1, p2 = distortion[2], distortion[3]
        r2 = a * a + b * b
        radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
        ab = a * b
        da = a * radial + 2.0 * p1 * ab + p2 * (r2 + 2.0 * a * a)
        b = b * radial + p1 * (r2 + 2.0 * b * b) + 2.0 * p2 * ab
        a = da
    out[0] = k[0] * a + k[1] * b + k[2]
    out[1] = k[3] * b + k[4]


@njit(cache=True, nogil=True)  # type: ignore[misc]
def cone_outline(ends, k, distortion, distorted, points, sides):  # type: ignore[no-untyped-def]
    """Outline of a cone given in the camera's frame.

    Args:
        ends: (2, 3, 3) per end its centre and its two radius vectors, m, camera frame.
        k: (5,) fx, skew, cx, fy, cy.
        distortion, distorted: (5,) and whether any of it matters.
        points: (MAX_POINTS, 2) px, filled with the polygon.
        sides: (3, 2, 2) px, filled with the two sides' and the far end's first and last point.

    Returns:
        Number of polygon points; 0 if the cone comes too near to the camera's plane.
    """
    flat = np.empty((2, 3, 2))
    for e in range(2):
        depth = ends[e, 0, 2]
        reach = abs(ends[e, 1, 2]) + abs(ends[e, 2, 2])
        if not depth - reach > NEAR_M:
            return 0
        # The ellipse's image to first order: good enough to find the tangents' angles.
        x, y = ends[e, 0, 0] / depth, ends[e, 0, 1] / depth
        flat[e, 0, 0], flat[e, 0, 1] = x, y
        for m in range(1, 3):
            flat[e, m, 0] = (ends[e, m, 0] - x * ends[e, m, 2]) / depth
            flat[e, m, 1] = (ends[e, m, 1] - y * ends[e, m, 2]) / depth
    dx = flat[1, 0, 0] - flat[0, 0, 0]
    dy = flat[1, 0, 1] - flat[0, 0, 1]
    gap = np.sqrt(dx * dx + dy * dy)
    inner = -1
    if gap < 1e-9:
        inner = 1 if _support(flat, 0, 1.0, 0.0) > _support(flat, 1, 1.0, 0.0) else 0
    else:
        dx, dy = dx / gap, dy / gap
        if gap + _support(flat, 1, dx, dy) <= _support(flat, 0, dx, dy):
            inner = 1
        elif gap + _support(flat, 0, dx, dy) <= _support(flat, 1, dx, dy):
            inner = 0
    turn = 2.0 * np.pi
    if inner >= 0:
        # Seen end-on: one ellipse hides the other and is the whole outline.
        count = 2 * ARC_POINTS - 2
        outer = 1 - inner
        sweep = turn * (1.0 - 1.0 / count)
        _arc(ends, outer, 0.0, sweep, count, k, distortion, distorted, points, 0)
        for s in range(3):
            for i in range(2):
                sides[s, 0, i] = np.nan
                sides[s, 1, i] = np.nan
        return count

    angle = np.empty((2, 2))
    for side in range(2):
        sense = 1.0 if side == 0 else -1.0
        nx, ny = -dy * sense, dx * sense
        for _ in range(2):
            gx = flat[1, 0, 0] - flat[0, 0, 0]
            gy = flat[1, 0, 1] - flat[0, 0, 1]
            for e in range(2):
                towards = 1.0 if e == 1 else -1.0
                pa = flat[e, 1, 0] * nx + flat[e, 1, 1] * ny
                pb = flat[e, 2, 0] * nx + flat[e, 2, 1] * ny
                length = np.sqrt(pa * pa + pb * pb) + 1e-300
                gx += towards * (flat[e, 1, 0] * pa + flat[e, 2, 0] * pb) / length
                gy += towards * (flat[e, 1, 1] * pa + flat[e, 2, 1] * pb) / length
            length = np.sqrt(gx * gx + gy * gy) + 1e-300
            nx, ny = -gy / length * sense, gx / length * sense
        for e in range(2):
            angle[e, side] = np.arctan2(
                flat[e, 2, 0] * nx + flat[e, 2, 1] * ny, flat[e, 1, 0] * nx + flat[e, 1, 1] * ny
            )

    steps = SIDE_SEGMENTS if distorted else 1
    n = 0
    # Up the first side, the far end (end 1) from side 0 to side 1, down, and around end 0.
    for e in (1, 0):
        start = angle[e, 1 - e]
        sweep = angle[e, e] - start
        # Which way round leads over the outside depends on how the camera sees the ellipse.
        seen = flat[e, 1, 0] * flat[e, 2, 1] - flat[e, 1, 1] * flat[e, 2, 0]
        if seen > 0.0:
            if sweep > 0.0:
                sweep -= turn
        elif sweep < 0.0:
            sweep += turn
        _arc(ends, e, start, sweep, ARC_POINTS, k, distortion, distorted, points, n)
        n += ARC_POINTS
        if steps > 1:
            _side(ends, e, angle[e, e], angle[1 - e, e], steps, k, distortion, distorted, points, n)
            n += steps - 1
    far = ARC_POINTS + steps - 1
    for i in range(2):
        sides[0, 0, i] = points[far + ARC_POINTS - 1, i]
        sides[0, 1, i] = points[0, i]
        sides[1, 0, i] = points[far, i]
        sides[1, 1, i] = points[ARC_POINTS - 1, i]
        sides[2, 0, i] = points[0, i]
        sides[2, 1, i] = points[ARC_POINTS - 1, i]
    return n


@njit(cache=True, nogil=True)  # type: ignore[misc]
def _support(flat, e, nx, ny):  # type: ignore[no-untyped-def]
    """How far end e reaches from its centre in a direction."""
    pa = flat[e, 1, 0] * nx + flat[e, 1, 1] * ny
    pb = flat[e, 2, 0] * nx + flat[e, 2, 1] * ny
    return np.sqrt(pa * pa + pb * pb)


@njit(cache=True, nogil=True)  # type: ignore[misc]
def _arc(ends, e, start, sweep, count, k, distortion, distorted, points, n):  # type: ignore[no-untyped-def]
    """Project `count` points of an end's ellipse, from an angle on, into points[n:]."""
    step = sweep / (count - 1)
    cos, sin = np.cos(start), np.sin(start)
    turn_cos, turn_sin = np.cos(step), np.sin(step)
    for i in range(count):
        project_point(
            ends[e, 0, 0] + cos * ends[e, 1, 0] + sin * ends[e, 2, 0],
            ends[e, 0, 1] + cos * ends[e, 1, 1] + sin * ends[e, 2, 1],
            ends[e, 0, 2] + cos * ends[e, 1, 2] + sin * ends[e, 2, 2],
            k, distortion, distorted, points[n + i],
        )  # fmt: skip
        cos, sin = cos * turn_cos - sin * turn_sin, sin * turn_cos + cos * turn_sin


@njit(cache=True, nogil=True)  # type: ignore[misc]
def _side(ends, e, angle, other, steps, k, distortion, distorted, points, n):  # type: ignore[no-untyped-def]
    """Project the inner points of the side from end e to the other end into points[n:]."""
    o = 1 - e
    ca, sa, cb, sb = np.cos(angle), np.sin(angle), np.cos(other), np.sin(other)
    p = np.empty(3)
    for i in range(1, steps):
        t = i / steps
        for m in range(3):
            a = ends[e, 0, m] + ca * ends[e, 1, m] + sa * ends[e, 2, m]
            b = ends[o, 0, m] + cb * ends[o, 1, m] + sb * ends[o, 2, m]
            p[m] = a + t * (b - a)
        project_point(p[0], p[1], p[2], k, distortion, distorted, points[n + i - 1])
