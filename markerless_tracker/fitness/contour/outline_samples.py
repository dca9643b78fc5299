"""Points on the outline of the whole body in one view, for contour refinement.

Derivation: docs/outlines-of-cones.md.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.camera.lens import distorts, lens
from markerless_tracker.compiled import inlined, kernel
from markerless_tracker.fitness.raster.bits import is_set
from markerless_tracker.fitness.raster.fill import clear_used, fill_outline, wipe
from markerless_tracker.fitness.raster.outline import find_outlines
from markerless_tracker.fitness.raster.outline_arrays import (
    HIDDEN,
    LANES,
    ONLY_END,
    TAPERED,
    outlines_of,
)
from markerless_tracker.fitness.raster.tangents import arc_sweep
from markerless_tracker.geometry import FloatArray

MAX_SAMPLES = 2048
"""Largest number of the model's outline points in one view, a power of 2 (`nearest`); further
points are dropped."""


class Samples(NamedTuple):
    """Outline points of the model in v views, at most s per view.

    Attributes:
        pixel, normal: (v, s, 2) px, and the outward unit normal.
        world: (v, s, 3) the point on the cone's surface, m.
        depth: (v, s) its depth, m.
        length: (v, s) represented length of outline, m.
        cone: (v, s) index of the cone.
        place: (v, s, 5) cos and sin on end 0, cos and sin on end 1, fraction t of end 1: the point
            is (1 - t) (centre_0 + cos a_0 + sin b_0) + t (centre_1 + cos a_1 + sin b_1).
        count: (v,).
    """

    pixel: FloatArray
    normal: FloatArray
    world: FloatArray
    depth: FloatArray
    length: FloatArray
    cone: NDArray[np.int64]
    place: FloatArray
    count: NDArray[np.int64]  # type: ignore[assignment]


def make_samples(views: int) -> Samples:
    """Allocate the arrays for outline points."""
    s = (views, MAX_SAMPLES)
    return Samples(
        np.empty((*s, 2)), np.empty((*s, 2)), np.empty((*s, 3)), np.empty(s), np.empty(s),
        np.empty(s, dtype=np.int64), np.empty((*s, 5)), np.zeros(views, dtype=np.int64),
    )  # fmt: skip


@inlined
def _pixel(x, y, z, k, distortion, distorted):  # type: ignore[no-untyped-def]
    """Pixel of a point of the camera's frame in front of it."""
    a, b = x / z, y / z
    if distorted:
        a, b = lens(a, b, distortion)
    return k[0] * a + k[1] * b + k[2], k[3] * b + k[4]


@inlined
def _shows(pu, pv, nu, nv, step_px, width, height, bits):  # type: ignore[no-untyped-def]
    """Whether a point lies in the frame and no cone covers the pixel `step_px` outside of it."""
    seen = False
    if pu >= 0.0 and pv >= 0.0 and pu <= width - 1.0 and pv <= height - 1.0:
        u = np.int64(np.floor(pu + step_px * nu + 0.5))
        v = np.int64(np.floor(pv + step_px * nv + 0.5))
        outside = u < 0 or v < 0 or u >= width or v >= height
        seen = True if outside else not is_set(bits, height, u, v)
    return seen


@kernel
def _sample_arc(  # type: ignore[no-untyped-def]
    kept, c, e, sweep, spacing_px, step_px, k, distortion, distorted, width, height, arcs, flat,
    ends, world, bits, pixel, normal, point, depth, length, cone, place,
):  # fmt: skip
    """Sample an end's arc into one view's arrays of `Samples`; returns their new number."""
    at = 6 * e * LANES + c
    au, av = flat[at + 2 * LANES], flat[at + 3 * LANES]
    bu, bv = flat[at + 4 * LANES], flat[at + 5 * LANES]
    radius = np.sqrt(max(au * au + av * av, bu * bu + bv * bv))
    n = np.int64(min(max(3.0, np.ceil(radius * k[0] * abs(sweep) / spacing_px)), 200.0))
    step = sweep / n
    step_cos, step_sin = np.cos(step), np.sin(step)
    # The arc begins half a step before its first point.
    half_cos, half_sin = np.cos(0.5 * step), np.sin(0.5 * step)
    cos, sin = arcs[4 * e * LANES + c], arcs[(4 * e + 1) * LANES + c]
    cos, sin = cos * half_cos - sin * half_sin, sin * half_cos + cos * half_sin
    p = 9 * e * LANES + c
    x0, y0, z0 = ends[p], ends[p + LANES], ends[p + 2 * LANES]
    xa, ya, za = ends[p + 3 * LANES], ends[p + 4 * LANES], ends[p + 5 * LANES]
    xb, yb, zb = ends[p + 6 * LANES], ends[p + 7 * LANES], ends[p + 8 * LANES]
    for _ in range(n):
        # (tu, tv): tangent in the image. The outward normal is perpendicular to it.
        tu, tv = k[0] * (cos * bu - sin * au), k[3] * (cos * bv - sin * av)
        mu, mv = k[0] * (cos * au + sin * bu), k[3] * (cos * av + sin * bv)
        norm = np.sqrt(tu * tu + tv * tv)
        if norm > 0.0 and kept < cone.size:
            side = (1.0 if tv * mu - tu * mv >= 0.0 else -1.0) / norm
            nu, nv = tv * side, -tu * side
            z = z0 + cos * za + sin * zb
            pu, pv = _pixel(
                x0 + cos * xa + sin * xb, y0 + cos * ya + sin * yb, z, k, distortion, distorted
            )
            if _shows(pu, pv, nu, nv, step_px, width, height, bits):
                pixel[kept, 0], pixel[kept, 1] = pu, pv
                normal[kept, 0], normal[kept, 1] = nu, nv
                for i in range(3):
                    row = p + i * LANES
                    point[kept, i] = (
                        world[row] + cos * world[row + 3 * LANES] + sin * world[row + 6 * LANES]
                    )
                depth[kept] = z
                length[kept] = norm * abs(step) * z / k[0]
                cone[kept] = c
                place[kept, 0], place[kept, 1] = cos, sin
                place[kept, 2], place[kept, 3] = cos, sin
                place[kept, 4] = e
                kept += 1
        cos, sin = cos * step_cos - sin * step_sin, sin * step_cos + cos * step_sin
    return kept


@kernel
def _sample_side(  # type: ignore[no-untyped-def]
    kept, c, side, spacing_px, step_px, k, distortion, distorted, width, height, arcs, ends, world,
    bits, pixel, normal, point, depth, length, cone, place,
):  # fmt: skip
    """Sample a side, as `_sample_arc`."""
    # Side 0 goes from the end of end 0's arc to the start of end 1's arc, side 1 back.
    at_0 = (2 if side == 0 else 0) * LANES + c
    at_1 = (4 if side == 0 else 6) * LANES + c
    c0, s0, c1, s1 = arcs[at_0], arcs[at_0 + LANES], arcs[at_1], arcs[at_1 + LANES]
    q = 9 * LANES + c
    x0 = ends[c] + c0 * ends[c + 3 * LANES] + s0 * ends[c + 6 * LANES]
    y0 = ends[c + LANES] + c0 * ends[c + 4 * LANES] + s0 * ends[c + 7 * LANES]
    z0 = ends[c + 2 * LANES] + c0 * ends[c + 5 * LANES] + s0 * ends[c + 8 * LANES]
    x1 = ends[q] + c1 * ends[q + 3 * LANES] + s1 * ends[q + 6 * LANES]
    y1 = ends[q + LANES] + c1 * ends[q + 4 * LANES] + s1 * ends[q + 7 * LANES]
    z1 = ends[q + 2 * LANES] + c1 * ends[q + 5 * LANES] + s1 * ends[q + 8 * LANES]
    u0, v0 = _pixel(x0, y0, z0, k, distortion, distorted)
    u1, v1 = _pixel(x1, y1, z1, k, distortion, distorted)
    du, dv = u1 - u0, v1 - v0
    whole = np.sqrt(du * du + dv * dv)
    if not whole > 0.0:
        return kept
    n = np.int64(min(max(1.0, np.ceil(whole / spacing_px)), 400.0))
    nu, nv = (-dv / whole, du / whole) if side == 0 else (dv / whole, -du / whole)
    for i in range(n):
        s = (i + 0.5) / n
        # Equal steps in the image are not equal steps along the cone.
        t = s * z0 / (z1 * (1.0 - s) + s * z0)
        z = z0 + t * (z1 - z0)
        pu, pv = _pixel(x0 + t * (x1 - x0), y0 + t * (y1 - y0), z, k, distortion, distorted)
        if kept < cone.size and _shows(pu, pv, nu, nv, step_px, width, height, bits):
            pixel[kept, 0], pixel[kept, 1] = pu, pv
            normal[kept, 0], normal[kept, 1] = nu, nv
            for j in range(3):
                a, b = c + j * LANES, q + j * LANES
                near = world[a] + c0 * world[a + 3 * LANES] + s0 * world[a + 6 * LANES]
                far = world[b] + c1 * world[b + 3 * LANES] + s1 * world[b + 6 * LANES]
                point[kept, j] = (1.0 - t) * near + t * far
            depth[kept] = z
            length[kept] = whole / n * z / k[0]
            cone[kept] = c
            place[kept, 0], place[kept, 1], place[kept, 2], place[kept, 3] = c0, s0, c1, s1
            place[kept, 4] = t
            kept += 1
    return kept


@kernel
def sample_outline(view, views, cones, spacing_px, step_px, scratch, outlines, samples):  # type: ignore[no-untyped-def]
    """Fill samples with the points of one view's outline of the whole body, `spacing_px` apart."""
    k, distortion = views.intrinsics[view], views.distortion[view]
    distorted = distorts(distortion)
    width, height, words = views.size[view, 0], views.size[view, 1], views.words[view]
    world, bits, used = scratch.world, scratch.bits[view], scratch.used[view]
    out = outlines_of(outlines, view)
    flat, arcs, ends, forms = out.flat, out.arcs, out.ends, out.form
    count = find_outlines(cones, views, view, world, out)
    clear_used(words, height, used)
    for c in range(cones):
        if forms[c] != HIDDEN:
            fill_outline(c, count, out, width, height, bits, used)
    pixel, normal, point = samples.pixel[view], samples.normal[view], samples.world[view]
    depth, length = samples.depth[view], samples.length[view]
    cone, place = samples.cone[view], samples.place[view]
    # A literal would make numba compile the functions once more.
    kept = np.int64(0)
    for c in range(cones):
        if forms[c] == HIDDEN:
            continue
        for e in range(2):
            if forms[c] == TAPERED or forms[c] == ONLY_END + e:
                sweep = arc_sweep(e, c, flat, forms, arcs)
                kept = _sample_arc(
                    kept, c, e, sweep, spacing_px, step_px, k, distortion, distorted, width,
                    height, arcs, flat, ends, world, bits, pixel, normal, point, depth, length,
                    cone, place,
                )  # fmt: skip
        if forms[c] == TAPERED:
            for side in range(2):
                kept = _sample_side(
                    kept, c, side, spacing_px, step_px, k, distortion, distorted, width, height,
                    arcs, ends, world, bits, pixel, normal, point, depth, length, cone, place,
                )  # fmt: skip
    samples.count[view] = kept
    wipe(words, height, bits, used)
