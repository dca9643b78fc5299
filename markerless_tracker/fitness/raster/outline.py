"""Outlines of all cones in one view: convex hulls of their two projected end ellipses.

An outline is a closed polygon: around end 1, down one side, around end 0, up the other side. The
sides are the common tangents of the end ellipses; the ends are sampled. All cones are computed
in parallel (`outline_arrays`). Derivation: docs/outlines-of-cones.md.
"""

import numpy as np

from markerless_tracker.camera.lens import distorts
from markerless_tracker.compiled import kernel
from markerless_tracker.fitness.raster.outline_arrays import (
    ARC_POINTS,
    LANES,
    MAX_POINTS,
    ONLY_END,
    SIDE_POINTS,
    VECTOR_LANES,
)
from markerless_tracker.fitness.raster.outline_points import (
    place_arc,
    place_point,
    place_side,
    to_pixels,
)
from markerless_tracker.fitness.raster.tangents import find_forms, find_tangents, to_camera

# cos and sin around a full circle, for polygons without and with points inside the sides.
_CIRCLES = tuple(
    np.array([np.cos(angle), np.sin(angle)])
    for angle in (
        2.0 * np.pi * np.arange(2 * ARC_POINTS) / (2 * ARC_POINTS),
        2.0 * np.pi * np.arange(MAX_POINTS) / MAX_POINTS,
    )
)


@kernel
def scan_edges(cones, count, height, u, v, first, slope, box):  # type: ignore[no-untyped-def]
    """Fill first, slope and box from polygons of `count` points in a frame of `height` rows."""
    n = (cones + VECTOR_LANES - 1) // VECTOR_LANES * VECTOR_LANES
    limit = np.float64(height)
    for c in range(n):
        box[c], box[LANES + c] = np.inf, -np.inf
        box[2 * LANES + c], box[3 * LANES + c] = np.inf, -np.inf
    # Several short loops: a loop over many arrays is not vectorised, since any two may overlap.
    for i in range(count):
        at, before = i * LANES, (i - 1 if i > 0 else count - 1) * LANES
        for c in range(n):
            slope[at + c] = (u[at + c] - u[before + c]) / (v[at + c] - v[before + c])
        for c in range(n):
            y = v[at + c]
            # Comparisons with NaN are false: NaN gives row 0.
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
    ends, flat, arcs, u, v = out.ends, out.flat, out.arcs, out.u, out.v
    end, far = 9 * LANES, near * LANES
    place_arc(cones, ends[end:], flat[6 * LANES :], arcs[4 * LANES :], u, v)
    place_arc(cones, ends, flat, arcs, u[far:], v[far:])
    if distorted:
        last = (ARC_POINTS - 1) * LANES
        place_side(
            cones, ends[end:], arcs[6 * LANES :], ends, arcs, u[last:], v[last:], u[far:], v[far:]
        )
        last += far
        place_side(
            cones, ends, arcs[2 * LANES :], ends[end:], arcs[4 * LANES :], u[last:], v[last:], u, v
        )
    for c in range(cones):
        if out.form[c] >= ONLY_END:
            circle = _CIRCLES[1] if distorted else _CIRCLES[0]
            at = 9 * (out.form[c] - ONLY_END) * LANES + c
            for i in range(count):
                place_point(circle[0, i], circle[1, i], at, i * LANES + c, out.ends, out.u, out.v)
    to_pixels(cones, count, views.intrinsics[view], distortion, distorted, out.u, out.v)
    scan_edges(cones, count, views.size[view, 1], out.u, out.v, out.first, out.slope, out.box)
    return count
