"""Outlines of all cones that one view sees: convex hulls of their two projected end ellipses.

An outline is a closed polygon: around the far end, down one side, around the near end, up the
other side. Sides touch the end ellipses at their common tangents; ends are sampled. All cones are
worked on side by side: a quantity is a row of `LANES` numbers, one a cone, and each loop over the
cones is one that the compiler turns into vector instructions.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.compiled import inlined, kernel
from markerless_tracker.geometry import FloatArray

LANES = 64
"""Numbers in a row, and the most cones of a body."""
ARC_POINTS = 7
"""Points of an end's arc between the two tangents, both included."""
SIDE_POINTS = 2
"""Points inside a side that is seen through a distorting lens; none otherwise."""
MAX_POINTS = 2 * (ARC_POINTS + SIDE_POINTS)
NEAR_M = 0.1
"""Cones that come nearer to a camera's plane than this are not drawn in it."""
HIDDEN, TAPERED, ONLY_END = 0, 1, 2
"""Forms of an outline: not drawn; both ends show; ONLY_END + e: end e hides all the rest."""

_VECTOR = 8
"""Loops run over a multiple of this many lanes, so that none is left over."""
_TINY = 1e-300
# cos and sin around a full turn, for polygons without and with points inside the sides.
_TURNS = tuple(
    np.array([np.cos(angle), np.sin(angle)])
    for angle in (
        2.0 * np.pi * np.arange(2 * ARC_POINTS) / (2 * ARC_POINTS),
        2.0 * np.pi * np.arange(MAX_POINTS) / MAX_POINTS,
    )
)
# 2 cos(h / 3) as a line in cos h, exact for arcs of no turn and of half a turn.
_THIRD_0, _THIRD_1 = np.sqrt(3.0), 2.0 - np.sqrt(3.0)


class Outlines(NamedTuple):
    """Working memory of one view's outlines: rows of `LANES` numbers, one after the other.

    Attributes:
        ends: 18 rows: row 9 e + 3 m + i holds coordinate i (m, camera frame) of end e's centre
            (m = 0) and of its two radius vectors (m = 1, 2).
        flat: 12 rows: row 6 e + 2 m + i holds their images to first order, at focal length 1.
        arcs: 8 rows: from row 4 e on cos and sin of the angle at which end e's arc begins and of
            that at which it ends. End 1's arc leads from side 0 to side 1, end 0's back. Side 0
            lies to the right of the way from end 0 to end 1 as the camera sees it (y down).
        form: one row: HIDDEN, TAPERED, or ONLY_END + e, whose arc is then a full turn.
        u, v: MAX_POINTS rows each, the polygons' points, px.
        first: MAX_POINTS rows, the first pixel row at or below each point, 0 .. height.
        slope: MAX_POINTS rows, du/dv of the edge that leads to each point.
        box: 4 rows, least and largest u (px), least and largest `first`.
        left, right: where the polygon that is being filled begins and ends in each row of the
            frame, px.
    """

    ends: FloatArray
    flat: FloatArray
    arcs: FloatArray
    form: NDArray[np.int64]
    u: FloatArray
    v: FloatArray
    first: NDArray[np.int32]
    slope: FloatArray
    box: FloatArray
    left: FloatArray
    right: FloatArray


def make_outlines(threads: int, height: int) -> Outlines:
    """Allocate working memory for some threads and frames of at most `height` rows.

    Every attribute gets a first axis, the thread.
    """

    def rows(count: int) -> FloatArray:
        # Lanes without a cone are worked on too; ones keep them harmless.
        return np.ones((threads, count * LANES))

    return Outlines(
        rows(18), rows(12), rows(8), np.zeros((threads, LANES), dtype=np.int64),
        rows(MAX_POINTS), rows(MAX_POINTS),
        np.zeros((threads, MAX_POINTS * LANES), dtype=np.int32), rows(MAX_POINTS), rows(4),
        np.zeros((threads, height)), np.zeros((threads, height)),
    )  # fmt: skip


@inlined
def outlines_of(all_threads, i):  # type: ignore[no-untyped-def]
    """Thread i's part of `make_outlines`."""
    a = all_threads
    return Outlines(
        a.ends[i], a.flat[i], a.arcs[i], a.form[i], a.u[i], a.v[i], a.first[i], a.slope[i],
        a.box[i], a.left[i], a.right[i],
    )  # fmt: skip


@kernel
def lens(a, b, distortion):  # type: ignore[no-untyped-def]
    """Where a lens (5,) k1 k2 p1 p2 k3 moves a point of the plane at focal length 1."""
    k1, k2, k3 = distortion[0], distortion[1], distortion[4]
    p1, p2 = distortion[2], distortion[3]
    r2 = a * a + b * b
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    ab = a * b
    return (
        a * radial + 2.0 * p1 * ab + p2 * (r2 + 2.0 * a * a),
        b * radial + p1 * (r2 + 2.0 * b * b) + 2.0 * p2 * ab,
    )


@kernel
def distorts(distortion):  # type: ignore[no-untyped-def]
    """Whether any coefficient (5,) of a lens is not zero."""
    for i in range(5):
        if distortion[i] != 0.0:
            return True
    return False


@kernel
def to_camera(cones, world, rotation, translation, ends):  # type: ignore[no-untyped-def]
    """Cone ends (18 rows) of the world in a camera's frame."""
    n = (cones + _VECTOR - 1) // _VECTOR * _VECTOR
    for e in range(2):
        for i in range(3):
            r0, r1, r2 = rotation[i, 0], rotation[i, 1], rotation[i, 2]
            t = translation[i]
            for m in range(3):
                at = (9 * e + 3 * m) * LANES
                to = at + i * LANES
                for c in range(n):
                    ends[to + c] = (
                        r0 * world[at + c]
                        + r1 * world[at + LANES + c]
                        + r2 * world[at + 2 * LANES + c]
                        + t
                    )
                t = 0.0


@kernel
def find_forms(cones, ends, flat, form):  # type: ignore[no-untyped-def]
    """Fill flat and form from ends."""
    n = (cones + _VECTOR - 1) // _VECTOR * _VECTOR
    for e in range(2):
        p, q = 9 * e * LANES, 6 * e * LANES
        for c in range(n):
            inverse = 1.0 / ends[p + 2 * LANES + c]
            x, y = ends[p + c] * inverse, ends[p + LANES + c] * inverse
            za, zb = ends[p + 5 * LANES + c], ends[p + 8 * LANES + c]
            flat[q + c], flat[q + LANES + c] = x, y
            flat[q + 2 * LANES + c] = (ends[p + 3 * LANES + c] - x * za) * inverse
            flat[q + 3 * LANES + c] = (ends[p + 4 * LANES + c] - y * za) * inverse
            flat[q + 4 * LANES + c] = (ends[p + 6 * LANES + c] - x * zb) * inverse
            flat[q + 5 * LANES + c] = (ends[p + 7 * LANES + c] - y * zb) * inverse
    for c in range(n):
        gu, gv = flat[6 * LANES + c] - flat[c], flat[7 * LANES + c] - flat[LANES + c]
        apart = gu * gu + gv * gv > 1e-18
        du, dv = (gu if apart else 1.0), (gv if apart else 0.0)
        # How far each end reaches from its centre along the way between them, times its length.
        pa = flat[2 * LANES + c] * du + flat[3 * LANES + c] * dv
        pb = flat[4 * LANES + c] * du + flat[5 * LANES + c] * dv
        qa = flat[8 * LANES + c] * du + flat[9 * LANES + c] * dv
        qb = flat[10 * LANES + c] * du + flat[11 * LANES + c] * dv
        reach = np.sqrt(qa * qa + qb * qb) - np.sqrt(pa * pa + pb * pb)
        gap = gu * du + gv * dv
        only = ONLY_END if gap + reach <= 0.0 else (ONLY_END + 1 if gap - reach <= 0.0 else TAPERED)
        near_0 = ends[2 * LANES + c] - abs(ends[5 * LANES + c]) - abs(ends[8 * LANES + c])
        near_1 = ends[11 * LANES + c] - abs(ends[14 * LANES + c]) - abs(ends[17 * LANES + c])
        near = near_0 if near_0 < near_1 else near_1
        form[c] = only if near > NEAR_M else HIDDEN


@kernel
def find_tangents(cones, flat, form, arcs):  # type: ignore[no-untyped-def]
    """Fill arcs: where the common tangents touch the ends.

    The line through the two points that reach farthest along its normal gives a better normal.
    """
    n = (cones + _VECTOR - 1) // _VECTOR * _VECTOR
    for side in range(2):
        sense = 1.0 if side == 0 else -1.0
        # Side 0 begins end 1's arc and ends end 0's.
        to_0, to_1 = (2 * LANES, 4 * LANES) if side == 0 else (0, 6 * LANES)
        for c in range(n):
            gu, gv = flat[6 * LANES + c] - flat[c], flat[7 * LANES + c] - flat[LANES + c]
            au, av = flat[2 * LANES + c], flat[3 * LANES + c]
            bu, bv = flat[4 * LANES + c], flat[5 * LANES + c]
            cu, cv = flat[8 * LANES + c], flat[9 * LANES + c]
            du, dv = flat[10 * LANES + c], flat[11 * LANES + c]
            nu, nv = -gv * sense, gu * sense
            for _ in range(2):
                pa, pb = au * nu + av * nv, bu * nu + bv * nv
                qa, qb = cu * nu + cv * nv, du * nu + dv * nv
                p = 1.0 / np.sqrt(pa * pa + pb * pb + _TINY)
                q = 1.0 / np.sqrt(qa * qa + qb * qb + _TINY)
                tu = gu + q * (cu * qa + du * qb) - p * (au * pa + bu * pb)
                tv = gv + q * (cv * qa + dv * qb) - p * (av * pa + bv * pb)
                nu, nv = -tv * sense, tu * sense
            pa, pb = au * nu + av * nv, bu * nu + bv * nv
            qa, qb = cu * nu + cv * nv, du * nu + dv * nv
            p = 1.0 / np.sqrt(pa * pa + pb * pb + _TINY)
            q = 1.0 / np.sqrt(qa * qa + qb * qb + _TINY)
            arcs[to_0 + c], arcs[to_0 + LANES + c] = pa * p, pb * p
            arcs[to_1 + c], arcs[to_1 + LANES + c] = qa * q, qb * q
    for c in range(cones):
        if form[c] >= ONLY_END:
            at = 4 * (form[c] - ONLY_END) * LANES + c
            arcs[at], arcs[at + LANES] = 1.0, 0.0
            arcs[at + 2 * LANES], arcs[at + 3 * LANES] = 1.0, 0.0


@kernel
def arc_sweep(e, c, flat, form, arcs):  # type: ignore[no-untyped-def]
    """The angle (rad) that end e's arc of cone c sweeps, by the way that leads over the outside."""
    if form[c] == ONLY_END + e:
        return 2.0 * np.pi
    at = 4 * e * LANES + c
    ca, sa = arcs[at], arcs[at + LANES]
    cb, sb = arcs[at + 2 * LANES], arcs[at + 3 * LANES]
    sweep = np.arctan2(ca * sb - sa * cb, ca * cb + sa * sb)
    if clockwise(6 * e * LANES + c, flat):
        return sweep - 2.0 * np.pi if sweep > 0.0 else sweep
    return sweep + 2.0 * np.pi if sweep < 0.0 else sweep


@inlined
def clockwise(at, flat):  # type: ignore[no-untyped-def]
    """Whether arcs of the end whose rows of flat begin at `at` run towards smaller angles."""
    return flat[at + 2 * LANES] * flat[at + 5 * LANES] > flat[at + 3 * LANES] * flat[at + 4 * LANES]


@inlined
def _place(cos, sin, at, to, ends, u, v):  # type: ignore[no-untyped-def]
    """Image at focal length 1 of the point at an angle of an end, into u and v at `to`."""
    inverse = 1.0 / (ends[at + 2 * LANES] + cos * ends[at + 5 * LANES] + sin * ends[at + 8 * LANES])
    u[to] = (ends[at] + cos * ends[at + 3 * LANES] + sin * ends[at + 6 * LANES]) * inverse
    v[to] = (ends[at + LANES] + cos * ends[at + 4 * LANES] + sin * ends[at + 7 * LANES]) * inverse


@kernel
def _arc(cones, e, row, ends, flat, arcs, u, v):  # type: ignore[no-untyped-def]
    """Place the points of end e's arc, from a row on.

    The middle halves the arc; points nearly at the thirds of either half are found from its ends
    a, b as the directions of w a + b and a + w b, without any angle.
    """
    n = (cones + _VECTOR - 1) // _VECTOR * _VECTOR
    at, way, to = 9 * e * LANES, 4 * e * LANES, row * LANES
    for c in range(n):
        ca, sa = arcs[way + c], arcs[way + LANES + c]
        cb, sb = arcs[way + 2 * LANES + c], arcs[way + 3 * LANES + c]
        sense = -1.0 if clockwise(6 * e * LANES + c, flat) else 1.0
        # The middle lies across the chord and along the sum; the longer of the two is sure.
        hc, hs = cb - ca, sb - sa
        mc, ms = ca + cb, sa + sb
        across = hc * hc + hs * hs > mc * mc + ms * ms
        flip = 1.0 if (ca * sb - sa * cb) * sense > 0.0 else -1.0
        mc, ms = (sense * hs if across else flip * mc), (-sense * hc if across else flip * ms)
        scale = 1.0 / np.sqrt(mc * mc + ms * ms + _TINY)
        mc, ms = mc * scale, ms * scale
        w = _THIRD_0 + _THIRD_1 * (ca * mc + sa * ms)
        _place(ca, sa, at + c, to + c, ends, u, v)
        pc, ps = w * ca + mc, w * sa + ms
        scale = 1.0 / np.sqrt(pc * pc + ps * ps + _TINY)
        _place(pc * scale, ps * scale, at + c, to + LANES + c, ends, u, v)
        pc, ps = ca + w * mc, sa + w * ms
        scale = 1.0 / np.sqrt(pc * pc + ps * ps + _TINY)
        _place(pc * scale, ps * scale, at + c, to + 2 * LANES + c, ends, u, v)
        _place(mc, ms, at + c, to + 3 * LANES + c, ends, u, v)
        pc, ps = cb + w * mc, sb + w * ms
        scale = 1.0 / np.sqrt(pc * pc + ps * ps + _TINY)
        _place(pc * scale, ps * scale, at + c, to + 4 * LANES + c, ends, u, v)
        pc, ps = w * cb + mc, w * sb + ms
        scale = 1.0 / np.sqrt(pc * pc + ps * ps + _TINY)
        _place(pc * scale, ps * scale, at + c, to + 5 * LANES + c, ends, u, v)
        _place(cb, sb, at + c, to + 6 * LANES + c, ends, u, v)


@kernel
def _side(cones, e, row, ends, arcs, u, v):  # type: ignore[no-untyped-def]
    """Place the inner points of the side that leaves end e, from a row on.

    Equal steps along the cone are not equal steps in the image.
    """
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
def _to_pixels(cones, count, k, distortion, distorted, u, v):  # type: ignore[no-untyped-def]
    """Turn points at focal length 1 into pixels."""
    n = (cones + _VECTOR - 1) // _VECTOR * _VECTOR
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


@kernel
def scan_edges(cones, count, height, u, v, first, slope, box):  # type: ignore[no-untyped-def]
    """Fill first, slope and box from polygons of `count` points in a frame of `height` rows."""
    n = (cones + _VECTOR - 1) // _VECTOR * _VECTOR
    limit = np.float64(height)
    for c in range(n):
        box[c], box[LANES + c] = np.inf, -np.inf
        box[2 * LANES + c], box[3 * LANES + c] = np.inf, -np.inf
    # Several short loops: the compiler gives up on one that touches many arrays, since any two of
    # them might overlap.
    for i in range(count):
        at, before = i * LANES, (i - 1 if i > 0 else count - 1) * LANES
        for c in range(n):
            slope[at + c] = (u[at + c] - u[before + c]) / (v[at + c] - v[before + c])
        for c in range(n):
            y = v[at + c]
            # Comparisons with NaN are false: it comes out as the frame's border.
            row = np.ceil(y) if y > 0.0 else 0.0
            row = row if row < limit else limit
            first[at + c] = np.int32(row)
            box[2 * LANES + c] = row if row < box[2 * LANES + c] else box[2 * LANES + c]
            box[3 * LANES + c] = row if row > box[3 * LANES + c] else box[3 * LANES + c]
        for c in range(n):
            x = u[at + c]
            box[c] = x if x < box[c] else box[c]
            box[LANES + c] = x if x > box[LANES + c] else box[LANES + c]


@kernel
def find_outlines(cones, views, view, world, out):  # type: ignore[no-untyped-def]
    """Fill `out`, one thread's `Outlines`, for cones whose ends lie at world (18 rows).

    Returns:
        Number of points of every polygon.
    """
    distortion = views.distortion[view]
    distorted = distorts(distortion)
    to_camera(cones, world, views.rotation[view], views.translation[view], out.ends)
    find_forms(cones, out.ends, out.flat, out.form)
    find_tangents(cones, out.flat, out.form, out.arcs)
    between = SIDE_POINTS if distorted else 0
    count = 2 * (ARC_POINTS + between)
    near = ARC_POINTS + between
    _arc(cones, 1, 0, out.ends, out.flat, out.arcs, out.u, out.v)
    _arc(cones, 0, near, out.ends, out.flat, out.arcs, out.u, out.v)
    if distorted:
        _side(cones, 1, ARC_POINTS, out.ends, out.arcs, out.u, out.v)
        _side(cones, 0, near + ARC_POINTS, out.ends, out.arcs, out.u, out.v)
    for c in range(cones):
        if out.form[c] >= ONLY_END:
            turn = _TURNS[1] if distorted else _TURNS[0]
            at = 9 * (out.form[c] - ONLY_END) * LANES + c
            for i in range(count):
                _place(turn[0, i], turn[1, i], at, i * LANES + c, out.ends, out.u, out.v)
    _to_pixels(cones, count, views.intrinsics[view], distortion, distorted, out.u, out.v)
    scan_edges(cones, count, views.size[view, 1], out.u, out.v, out.first, out.slope, out.box)
    return count
