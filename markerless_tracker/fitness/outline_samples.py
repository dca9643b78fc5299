"""Points on the outline of the whole body as one view sees it, for contour refinement."""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from markerless_tracker.fitness.bits import is_set
from markerless_tracker.fitness.fill import clear_used, fill_outline, wipe
from markerless_tracker.fitness.outline import (
    HIDDEN,
    LANES,
    ONLY_END,
    TAPERED,
    arc_sweep,
    distorts,
    find_outlines,
    lens,
    outlines_of,
)
from markerless_tracker.geometry import FloatArray

MAX_SAMPLES = 2048
"""Most outline points of the model in one view; later ones are not looked at."""


class Samples(NamedTuple):
    """Outline points of the model in v views, at most s each.

    Attributes:
        pixel, normal: (v, s, 2) where, and outward, px.
        world: (v, s, 3) the point on the cone's surface, m.
        depth: (v, s) its depth, m.
        length: (v, s) outline that it stands for, m.
        cone: (v, s).
        shape: (v, s, 5) cos and sin on end 0, cos and sin on end 1, share of end 1: the point is
            (1 - t) (centre_0 + cos a_0 + sin b_0) + t (centre_1 + cos a_1 + sin b_1).
        count: (v,).
    """

    pixel: FloatArray
    normal: FloatArray
    world: FloatArray
    depth: FloatArray
    length: FloatArray
    cone: NDArray[np.int64]
    shape: FloatArray
    count: NDArray[np.int64]  # type: ignore[assignment]


def make_samples(views: int) -> Samples:
    """Allocate room for outline points."""
    s = (views, MAX_SAMPLES)
    return Samples(
        np.empty((*s, 2)), np.empty((*s, 2)), np.empty((*s, 3)), np.empty(s), np.empty(s),
        np.empty(s, dtype=np.int64), np.empty((*s, 5)), np.zeros(views, dtype=np.int64),
    )  # fmt: skip


@njit(cache=True, nogil=True)  # type: ignore[misc]
def _surface(c, ends, shape):  # type: ignore[no-untyped-def]
    """The surface point x, y, z of cone c of ends (18 rows) that a sample's shape (5,) means."""
    return (
        _surface_at(c, ends, shape), _surface_at(c + LANES, ends, shape),
        _surface_at(c + 2 * LANES, ends, shape),
    )  # fmt: skip


@njit(cache=True, nogil=True)  # type: ignore[misc]
def _surface_at(at, ends, shape):  # type: ignore[no-untyped-def]
    a = ends[at] + shape[0] * ends[at + 3 * LANES] + shape[1] * ends[at + 6 * LANES]
    at += 9 * LANES
    b = ends[at] + shape[2] * ends[at + 3 * LANES] + shape[3] * ends[at + 6 * LANES]
    return (1.0 - shape[4]) * a + shape[4] * b


@njit(cache=True, nogil=True, error_model="numpy")  # type: ignore[misc]
def _pixel(x, y, z, k, distortion, distorted):  # type: ignore[no-untyped-def]
    """Pixel of a point of the camera's frame in front of it."""
    a, b = x / z, y / z
    if distorted:
        a, b = lens(a, b, distortion)
    return k[0] * a + k[1] * b + k[2], k[3] * b + k[4]


@njit(cache=True, nogil=True, error_model="numpy")  # type: ignore[misc]
def _add_sample(  # type: ignore[no-untyped-def]
    n, c, k, distortion, distorted, width, height, nu, nv, length_px, step_px, world, ends, bits,
    place, pixel, normal, point, depth, length, cone, shape,
):  # fmt: skip
    """Keep a point of one cone's outline if the pixel `step_px` outside it is free of the body.

    Returns:
        How many points are kept now; n of them are by now. The arrays are rows of `Samples`.
    """
    if n >= cone.size:
        return n
    x, y, z = _surface(c, ends, place)
    pu, pv = _pixel(x, y, z, k, distortion, distorted)
    norm = np.sqrt(nu * nu + nv * nv)
    if not norm > 0.0:
        return n
    nu, nv = nu / norm, nv / norm
    # Points outside the frame have no evidence.
    if not (pu >= 0.0 and pv >= 0.0 and pu <= width - 1.0 and pv <= height - 1.0):
        return n
    u = np.int64(np.floor(pu + step_px * nu + 0.5))
    v = np.int64(np.floor(pv + step_px * nv + 0.5))
    if 0 <= u < width and 0 <= v < height and is_set(bits, height, u, v):
        return n
    pixel[n, 0], pixel[n, 1] = pu, pv
    normal[n, 0], normal[n, 1] = nu, nv
    point[n, 0], point[n, 1], point[n, 2] = _surface(c, world, place)
    depth[n] = z
    length[n] = length_px * z / k[0]
    cone[n] = c
    for i in range(5):
        shape[n, i] = place[i]
    return n + 1


@njit(cache=True, nogil=True, error_model="numpy")  # type: ignore[misc]
def sample_outline(view, views, cones, spacing_px, step_px, scratch, outlines, samples):  # type: ignore[no-untyped-def]
    """Fill samples with the points of one view's outline of the whole body, `spacing_px` apart."""
    k = views.intrinsics[view]
    distortion = views.distortion[view]
    distorted = distorts(distortion)
    width, height, words = views.size[view, 0], views.size[view, 1], views.words[view]
    world, bits, used = scratch.world, scratch.bits[view], scratch.used[view]
    out = outlines_of(outlines, view)
    flat, arcs = out.flat, out.arcs
    count = find_outlines(cones, views, view, world, out)
    clear_used(words, height, used)
    for c in range(cones):
        if out.form[c] != HIDDEN:
            fill_outline(c, count, out, width, height, bits, used)

    # Plain arrays: taking one from a tuple for every point would cost more than the point.
    ends = out.ends
    pixel, normal, point = samples.pixel[view], samples.normal[view], samples.world[view]
    depth, lengths = samples.depth[view], samples.length[view]
    cone, shapes = samples.cone[view], samples.shape[view]
    shape = np.empty(5)
    kept = 0
    for c in range(cones):
        form = out.form[c]
        if form == HIDDEN:
            continue
        for e in range(2):
            if form != TAPERED and form != ONLY_END + e:
                continue
            sweep = arc_sweep(e, c, flat, out.form, arcs)
            at = 6 * e * LANES + c
            au, av = flat[at + 2 * LANES], flat[at + 3 * LANES]
            bu, bv = flat[at + 4 * LANES], flat[at + 5 * LANES]
            radius = np.sqrt(max(au * au + av * av, bu * bu + bv * bv))
            arc_px = radius * k[0] * abs(sweep)
            n = np.int64(min(max(3.0, np.ceil(arc_px / spacing_px)), 200.0))
            shape[4] = e
            begin = np.arctan2(arcs[(4 * e + 1) * LANES + c], arcs[4 * e * LANES + c])
            for i in range(n):
                angle = begin + sweep * (i + 0.5) / n
                cos, sin = np.cos(angle), np.sin(angle)
                shape[0], shape[1], shape[2], shape[3] = cos, sin, cos, sin
                # Along the arc, in the image; outward is across it, away from the middle.
                tu = k[0] * (cos * bu - sin * au)
                tv = k[3] * (cos * bv - sin * av)
                mu = k[0] * (cos * au + sin * bu)
                mv = k[3] * (cos * av + sin * bv)
                length = np.sqrt(tu * tu + tv * tv) * abs(sweep) / n
                nu, nv = tv, -tu
                if nu * mu + nv * mv < 0.0:
                    nu, nv = -nu, -nv
                kept = _add_sample(
                    kept, c, k, distortion, distorted, width, height, nu, nv, length, step_px,
                    world, ends, bits, shape, pixel, normal, point, depth, lengths, cone, shapes,
                )  # fmt: skip
        if form != TAPERED:
            continue
        for side in range(2):
            # Side 0 ends end 0's arc and begins end 1's; side 1 the other way.
            at_0 = (2 if side == 0 else 0) * LANES + c
            at_1 = (4 if side == 0 else 6) * LANES + c
            shape[0], shape[1] = arcs[at_0], arcs[at_0 + LANES]
            shape[2], shape[3] = arcs[at_1], arcs[at_1 + LANES]
            shape[4] = 0.0
            x, y, z0 = _surface(c, ends, shape)
            u0, v0 = _pixel(x, y, z0, k, distortion, distorted)
            shape[4] = 1.0
            x, y, z1 = _surface(c, ends, shape)
            u1, v1 = _pixel(x, y, z1, k, distortion, distorted)
            du, dv = u1 - u0, v1 - v0
            length = np.sqrt(du * du + dv * dv)
            n = np.int64(min(max(1.0, np.ceil(length / spacing_px)), 400.0))
            nu, nv = (-dv, du) if side == 0 else (dv, -du)
            for i in range(n):
                s = (i + 0.5) / n
                # Equal steps in the image are not equal steps along the cone.
                shape[4] = s * z0 / (z1 * (1.0 - s) + s * z0)
                kept = _add_sample(
                    kept, c, k, distortion, distorted, width, height, nu, nv, length / n, step_px,
                    world, ends, bits, shape, pixel, normal, point, depth, lengths, cone, shapes,
                )  # fmt: skip
    samples.count[view] = kept
    wipe(words, height, bits, used)
