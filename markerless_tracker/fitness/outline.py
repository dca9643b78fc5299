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
HIDDEN, TAPERED, ONLY_END = 0, 1, 2
"""Forms of an outline; see `cone_tangents`."""


@njit(cache=True, nogil=True)  # type: ignore[misc]
def project_point(x, y, z, k, distortion, distorted, out, row):  # type: ignore[no-untyped-def]
    """Pixel (u, v) of a point of the camera's frame in front of it, into a row of out (n, 2)."""
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
    out[row, 0] = k[0] * a + k[1] * b + k[2]
    out[row, 1] = k[3] * b + k[4]


@njit(cache=True, nogil=True)  # type: ignore[misc]
def cone_tangents(ends, flat, arcs):  # type: ignore[no-untyped-def]
    """Where the outline of a cone given in the camera's frame runs along its end ellipses.

    Args:
        ends: (2, 3, 3) per end its centre and its two radius vectors, m, camera frame.
        flat: (2, 3, 2) filled with their images to first order, at focal length 1.
        arcs: (2, 5) filled per end with cos and sin of the angle at which its arc begins, those of
            the angle at which it ends, and the angle it sweeps, rad. End 1's arc leads from the
            first side to the second, end 0's back. The sides join the end of one arc to the
            beginning of the other; side 0 lies to the right of the
            way from end 0 to end 1 as the camera sees it (y down), side 1 to the left.

    Returns:
        HIDDEN if the cone comes too near to the camera's plane, TAPERED, or, where one end's
        ellipse hides all the rest, ONLY_END + that end, whose arc is then a full turn.
    """
    for e in range(2):
        depth = ends[e, 0, 2]
        reach = abs(ends[e, 1, 2]) + abs(ends[e, 2, 2])
        if not depth - reach > NEAR_M:
            return HIDDEN
        x, y = ends[e, 0, 0] / depth, ends[e, 0, 1] / depth
        flat[e, 0, 0], flat[e, 0, 1] = x, y
        for m in range(1, 3):
            flat[e, m, 0] = (ends[e, m, 0] - x * ends[e, m, 2]) / depth
            flat[e, m, 1] = (ends[e, m, 1] - y * ends[e, m, 2]) / depth
    turn = 2.0 * np.pi
    gap_x = flat[1, 0, 0] - flat[0, 0, 0]
    gap_y = flat[1, 0, 1] - flat[0, 0, 1]
    gap = np.sqrt(gap_x * gap_x + gap_y * gap_y)
    outer = -1
    dx, dy = 1.0, 0.0
    if gap >= 1e-9:
        dx, dy = gap_x / gap, gap_y / gap
        if gap + _support(flat, 1, dx, dy) <= _support(flat, 0, dx, dy):
            outer = 0
        elif gap + _support(flat, 0, dx, dy) <= _support(flat, 1, dx, dy):
            outer = 1
    else:
        outer = 0 if _support(flat, 0, dx, dy) >= _support(flat, 1, dx, dy) else 1
    if outer >= 0:
        arcs[outer, 0], arcs[outer, 1] = 1.0, 0.0
        arcs[outer, 2], arcs[outer, 3] = 1.0, 0.0
        arcs[outer, 4] = turn
        return ONLY_END + outer

    for side in range(2):
        sense = 1.0 if side == 0 else -1.0
        nx, ny = -dy * sense, dx * sense
        for _ in range(2):
            # The line through the two points that reach farthest along n gives a better n.
            tx, ty = gap_x, gap_y
            for e in range(2):
                s = 1.0 if e == 1 else -1.0
                pa = flat[e, 1, 0] * nx + flat[e, 1, 1] * ny
                pb = flat[e, 2, 0] * nx + flat[e, 2, 1] * ny
                scale = s / (np.sqrt(pa * pa + pb * pb) + 1e-300)
                tx += scale * (flat[e, 1, 0] * pa + flat[e, 2, 0] * pb)
                ty += scale * (flat[e, 1, 1] * pa + flat[e, 2, 1] * pb)
            scale = sense / (np.sqrt(tx * tx + ty * ty) + 1e-300)
            nx, ny = -ty * scale, tx * scale
        for e in range(2):
            pa = flat[e, 1, 0] * nx + flat[e, 1, 1] * ny
            pb = flat[e, 2, 0] * nx + flat[e, 2, 1] * ny
            scale = 1.0 / (np.sqrt(pa * pa + pb * pb) + 1e-300)
            # Side 0 begins end 1's arc and ends end 0's.
            at = 0 if side != e else 2
            arcs[e, at], arcs[e, at + 1] = pa * scale, pb * scale
    for e in range(2):
        sweep = np.arctan2(
            arcs[e, 0] * arcs[e, 3] - arcs[e, 1] * arcs[e, 2],
            arcs[e, 0] * arcs[e, 2] + arcs[e, 1] * arcs[e, 3],
        )
        # Which way round leads over the outside depends on how the camera sees the ellipse.
        seen = flat[e, 1, 0] * flat[e, 2, 1] - flat[e, 1, 1] * flat[e, 2, 0]
        if seen > 0.0:
            if sweep > 0.0:
                sweep -= turn
        elif sweep < 0.0:
            sweep += turn
        arcs[e, 4] = sweep
    return TAPERED


@njit(cache=True, nogil=True)  # type: ignore[misc]
def cone_outline(ends, k, distortion, distorted, points, sides, flat, arcs):  # type: ignore[no-untyped-def]
    """Outline of a cone given in the camera's frame.

    Args:
        ends: (2, 3, 3) per end its centre and its two radius vectors, m, camera frame.
        k: (5,) fx, skew, cx, fy, cy.
        distortion, distorted: (5,) and whether any of it matters.
        points: (MAX_POINTS, 2) px, filled with the polygon.
        sides: (3, 2, 2) px, filled with the two sides' and the far end's first and last point;
            NaN where the cone has none.
        flat, arcs: (2, 3, 2) and (2, 5), working memory; see `cone_tangents`.

    Returns:
        Number of polygon points; 0 if the cone comes too near to the camera's plane.
    """
    form = cone_tangents(ends, flat, arcs)
    if form != TAPERED:
        for s in range(3):
            for i in range(2):
                sides[s, 0, i] = np.nan
                sides[s, 1, i] = np.nan
        if form == HIDDEN:
            return 0
        count = 2 * ARC_POINTS - 2
        sweep = 2.0 * np.pi * (1.0 - 1.0 / count)
        _arc(ends, form - ONLY_END, 1.0, 0.0, sweep, count, k, distortion, distorted, points, 0)
        return count

    steps = SIDE_SEGMENTS if distorted else 1
    n = 0
    # Around the far end (end 1) from side 0 to side 1, down side 1, around end 0, up side 0.
    for e in (1, 0):
        _arc(
            ends, e, arcs[e, 0], arcs[e, 1], arcs[e, 4], ARC_POINTS, k, distortion, distorted,
            points, n,
        )  # fmt: skip
        n += ARC_POINTS
        if steps > 1:
            _side(ends, e, arcs, steps, k, distortion, distorted, points, n)
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
def _arc(ends, e, cos, sin, sweep, count, k, distortion, distorted, points, n):  # type: ignore[no-untyped-def]
    """Project `count` points of an end's ellipse, from an angle's cos, sin on, into points[n:]."""
    step = sweep / (count - 1)
    turn_cos, turn_sin = np.cos(step), np.sin(step)
    for i in range(count):
        project_point(
            ends[e, 0, 0] + cos * ends[e, 1, 0] + sin * ends[e, 2, 0],
            ends[e, 0, 1] + cos * ends[e, 1, 1] + sin * ends[e, 2, 1],
            ends[e, 0, 2] + cos * ends[e, 1, 2] + sin * ends[e, 2, 2],
            k, distortion, distorted, points, n + i,
        )  # fmt: skip
        cos, sin = cos * turn_cos - sin * turn_sin, sin * turn_cos + cos * turn_sin


@njit(cache=True, nogil=True)  # type: ignore[misc]
def _side(ends, e, arcs, steps, k, distortion, distorted, points, n):  # type: ignore[no-untyped-def]
    """Project the inner points of the side from end e to the other end into points[n:]."""
    o = 1 - e
    ca, sa, cb, sb = arcs[e, 2], arcs[e, 3], arcs[o, 0], arcs[o, 1]
    for i in range(1, steps):
        t = i / steps
        x = _between(ends, e, o, ca, sa, cb, sb, t, 0)
        y = _between(ends, e, o, ca, sa, cb, sb, t, 1)
        z = _between(ends, e, o, ca, sa, cb, sb, t, 2)
        project_point(x, y, z, k, distortion, distorted, points, n + i - 1)


@njit(cache=True, nogil=True)  # type: ignore[misc]
def _between(ends, e, o, ca, sa, cb, sb, t, m):  # type: ignore[no-untyped-def]
    """Coordinate m of the point a share t of the way from end e to end o."""
    a = ends[e, 0, m] + ca * ends[e, 1, m] + sa * ends[e, 2, m]
    b = ends[o, 0, m] + cb * ends[o, 1, m] + sb * ends[o, 2, m]
    return a + t * (b - a)
