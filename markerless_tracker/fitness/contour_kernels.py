"""The compiled loops of contour refinement: a pose in, residuals and normal equations out.

Residuals are distances between two outlines, taken both ways and in metres at the body's depth:
outline points of the model to the silhouette's edge (its signed distance), and points of the
silhouette's edge to the nearest outline point of the model. Each carries the gradient with respect
to the 3D point on a cone's surface that makes it; the point moves rigidly with its cone, since
sliding along the surface does not move the outline to first order.
"""

from typing import NamedTuple

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from markerless_tracker.fitness.chain_kernels import SUMS, add_wrench, sum_chain
from markerless_tracker.fitness.kernels import cone_ends
from markerless_tracker.fitness.outline import LANES
from markerless_tracker.fitness.outline_samples import MAX_SAMPLES, sample_outline
from markerless_tracker.geometry import FloatArray

BAND_PX = 8
"""Rows of a frame whose outline points are looked through together for the nearest."""


class ContourViews(NamedTuple):
    """The silhouettes' edges of v views.

    Attributes:
        distance: signed distance to the silhouette's edge, px, positive outside, of a window per
            view, flat; view i's starts at distance_start[i].
        distance_start: (v,).
        window: (v, 4) left, top, width, height of the window, px.
        points: (n, 2) px, points of the edges, view after view from point_start[i] on.
        normals: (n, 2) outward, unit length.
        spacing: (n,) px of edge that each point stands for.
        point_start: (v + 1,).
    """

    distance: NDArray[np.float32]
    distance_start: NDArray[np.int64]
    window: NDArray[np.int64]
    points: FloatArray
    normals: FloatArray
    spacing: FloatArray
    point_start: NDArray[np.int64]


class Residuals(NamedTuple):
    """Residuals of v views, at most s each.

    Attributes:
        value: (v, s) m.
        weight: (v, s) length of outline it stands for (m) times its robust weight.
        gradient: (v, s, 3) with respect to the world point of its sample.
        sample: (v, s) index of that sample in its view.
        count: (v,).
        cost: (v,) sum of length times the robust cost, m³.
    """

    value: FloatArray
    weight: FloatArray
    gradient: FloatArray
    sample: NDArray[np.int64]
    count: NDArray[np.int64]  # type: ignore[assignment]
    cost: FloatArray


class ContourScratch(NamedTuple):
    """Working memory, per view: m nodes (once), c cones, frames of h rows of w words."""

    nodes: FloatArray  # (m, 3, 4)
    world: FloatArray  # (18 * LANES,), rows as of Outlines.ends
    bits: NDArray[np.uint64]  # (v, w * h), zero between calls
    used: NDArray[np.int64]  # (v, w, 2)
    start: NDArray[np.int64]  # (v, h / BAND_PX + 2)
    order: NDArray[np.int64]  # (v, MAX_SAMPLES)
    sums: FloatArray  # (v, m, SUMS)
    hessian: FloatArray  # (p, p)
    slope: FloatArray  # (p,)


def make_residuals(views: int, points: int) -> Residuals:
    """Allocate room for residuals: one per outline point and one per edge point."""
    s = (views, MAX_SAMPLES + points)
    return Residuals(
        np.empty(s), np.empty(s), np.empty((*s, 3)), np.empty(s, dtype=np.int64),
        np.zeros(views, dtype=np.int64), np.zeros(views),
    )  # fmt: skip


def make_contour_scratch(
    views: int, nodes: int, parameters: int, height: int, words: int
) -> ContourScratch:
    """Allocate working memory."""
    return ContourScratch(
        np.empty((nodes, 3, 4)),
        np.ones(18 * LANES),
        np.zeros((views, words * height), dtype=np.uint64),
        np.empty((views, words, 2), dtype=np.int64),
        np.empty((views, height // BAND_PX + 2), dtype=np.int64),
        np.empty((views, MAX_SAMPLES), dtype=np.int64),
        np.empty((views, nodes, SUMS)),
        np.empty((parameters, parameters)),
        np.empty(parameters),
    )


@njit(cache=True, nogil=True)  # type: ignore[misc]
def _distance_at(contours, view, u, v, out):  # type: ignore[no-untyped-def]
    """Bilinear signed distance, px, and its gradient into out (3,); False outside the window."""
    left, top = contours.window[view, 0], contours.window[view, 1]
    width, height = contours.window[view, 2], contours.window[view, 3]
    x, y = u - left, v - top
    if not (x >= 0.0 and y >= 0.0 and x < width - 1.0 and y < height - 1.0):
        return False
    i, j = np.int64(x), np.int64(y)
    fx, fy = x - i, y - j
    at = contours.distance_start[view] + j * width + i
    d00, d10 = contours.distance[at], contours.distance[at + 1]
    d01, d11 = contours.distance[at + width], contours.distance[at + width + 1]
    out[0] = (d00 * (1 - fx) + d10 * fx) * (1 - fy) + (d01 * (1 - fx) + d11 * fx) * fy
    out[1] = (d10 - d00) * (1 - fy) + (d11 - d01) * fy
    out[2] = (d01 - d00) * (1 - fx) + (d11 - d10) * fx
    return True


@njit(cache=True, nogil=True)  # type: ignore[misc]
def _world_gradient(views, view, point, du, dv, out):  # type: ignore[no-untyped-def]
    """Gradient (3,) of du * u + dv * v with respect to a world point, through the lens."""
    r, t = views.rotation[view], views.translation[view]
    k, d = views.intrinsics[view], views.distortion[view]
    x = r[0, 0] * point[0] + r[0, 1] * point[1] + r[0, 2] * point[2] + t[0]
    y = r[1, 0] * point[0] + r[1, 1] * point[1] + r[1, 2] * point[2] + t[1]
    z = r[2, 0] * point[0] + r[2, 1] * point[1] + r[2, 2] * point[2] + t[2]
    a, b = x / z, y / z
    r2 = a * a + b * b
    radial = 1.0 + r2 * (d[0] + r2 * (d[1] + r2 * d[4]))
    rate = 2.0 * (d[0] + r2 * (2.0 * d[1] + 3.0 * r2 * d[4]))
    aa = radial + a * a * rate + 2.0 * d[2] * b + 6.0 * d[3] * a
    ab = a * b * rate + 2.0 * d[2] * a + 2.0 * d[3] * b
    bb = radial + b * b * rate + 6.0 * d[2] * b + 2.0 * d[3] * a
    # d(u, v)/d(a, b), then d(a, b)/d(camera point), then to the world's axes.
    ga = du * (k[0] * aa + k[1] * ab) + dv * k[3] * ab
    gb = du * (k[0] * ab + k[1] * bb) + dv * k[3] * bb
    gx, gy = ga / z, gb / z
    gz = -(ga * a + gb * b) / z
    for i in range(3):
        out[i] = gx * r[0, i] + gy * r[1, i] + gz * r[2, i]


@njit(cache=True, nogil=True)  # type: ignore[misc]
def sort_into_bands(view, height, samples, start, order):  # type: ignore[no-untyped-def]
    """Sort one view's outline points into bands of BAND_PX rows; returns the number of bands.

    Band b holds the points order[start[b] : start[b + 1]].
    """
    bands = height // BAND_PX + 1
    start[: bands + 1] = 0
    for s in range(samples.count[view]):
        start[int(samples.pixel[view, s, 1]) // BAND_PX + 1] += 1
    for b in range(bands):
        start[b + 1] += start[b]
    for s in range(samples.count[view] - 1, -1, -1):
        b = int(samples.pixel[view, s, 1]) // BAND_PX + 1
        start[b] -= 1
        order[start[b]] = s
    # Each start has moved down to where its band begins, one place too far to the right.
    for b in range(bands):
        start[b] = start[b + 1]
    start[bands] = samples.count[view]
    return bands


@njit(cache=True, nogil=True)  # type: ignore[misc]
def _nearest(view, u, v, nu, nv, bands, samples, start, order):  # type: ignore[no-untyped-def]
    """The outline point nearest to a pixel among those that face as (nu, nv) does; -1: none."""
    best = np.inf
    nearest = -1
    home = min(max(np.int64(v) // BAND_PX, 0), bands - 1)
    for away in range(bands):
        # No point of a band that is `away` bands off is nearer than this many rows.
        if away > 0:
            rows = min(v - (home - away + 1) * BAND_PX, (home + away) * BAND_PX - v)
            if rows > 0 and rows * rows >= best:
                break
        for turn in range(2 if away > 0 else 1):
            band = home - away if turn == 0 else home + away
            if band < 0 or band >= bands:
                continue
            for i in range(start[band], start[band + 1]):
                s = order[i]
                du, dv = samples.pixel[view, s, 0] - u, samples.pixel[view, s, 1] - v
                gap = du * du + dv * dv
                if gap < best:
                    facing = samples.normal[view, s, 0] * nu + samples.normal[view, s, 1] * nv
                    if facing > 0.5:
                        best = gap
                        nearest = s
    return nearest


@njit(cache=True, nogil=True)  # type: ignore[misc]
def collect_residuals(view, views, contours, reach_m, samples, start, order, residuals):  # type: ignore[no-untyped-def]
    """Fill the residuals of one view, both ways.

    Robust weights are Tukey's, (1 - (r / reach)²)², and cost reach² / 6 (1 - (1 - (r / reach)²)³).
    """
    k = views.intrinsics[view]
    n = 0
    cost = 0.0
    found = np.empty(3)
    limit = reach_m * reach_m / 6.0
    for s in range(samples.count[view]):
        metres = samples.depth[view, s] / k[0]
        u, v = samples.pixel[view, s, 0], samples.pixel[view, s, 1]
        length = samples.length[view, s]
        cost += length * limit
        if not _distance_at(contours, view, u, v, found):
            continue
        value = found[0] * metres
        steep = np.sqrt(found[1] * found[1] + found[2] * found[2])
        if abs(value) >= reach_m or steep < 0.3:
            continue
        facing = found[1] * samples.normal[view, s, 0] + found[2] * samples.normal[view, s, 1]
        if facing < 0.5 * steep:
            continue
        share = 1.0 - (value / reach_m) ** 2
        cost -= length * limit * share**3
        residuals.value[view, n] = value
        residuals.weight[view, n] = length * share * share
        residuals.sample[view, n] = s
        _world_gradient(
            views, view, samples.world[view, s], metres * found[1], metres * found[2],
            residuals.gradient[view, n],
        )  # fmt: skip
        n += 1
    bands = sort_into_bands(view, views.size[view, 1], samples, start, order)
    for m in range(contours.point_start[view], contours.point_start[view + 1]):
        u, v = contours.points[m, 0], contours.points[m, 1]
        nu, nv = contours.normals[m, 0], contours.normals[m, 1]
        nearest = _nearest(view, u, v, nu, nv, bands, samples, start, order)
        metres = 0.0
        if nearest >= 0:
            metres = samples.depth[view, nearest] / k[0]
        elif samples.count[view] > 0:
            metres = samples.depth[view, 0] / k[0]
        length = contours.spacing[m] * metres
        cost += length * limit
        if nearest < 0:
            continue
        du = samples.pixel[view, nearest, 0] - u
        dv = samples.pixel[view, nearest, 1] - v
        gap = du * du + dv * dv
        if np.sqrt(gap) * metres >= reach_m:
            continue
        value = (du * nu + dv * nv) * metres
        share = 1.0 - gap * metres * metres / (reach_m * reach_m)
        cost -= length * limit * share**3
        residuals.value[view, n] = value
        residuals.weight[view, n] = length * share * share
        residuals.sample[view, n] = nearest
        _world_gradient(
            views, view, samples.world[view, nearest], metres * nu, metres * nv,
            residuals.gradient[view, n],
        )  # fmt: skip
        n += 1
    residuals.count[view] = n
    residuals.cost[view] = cost


@njit(cache=True, nogil=True)  # type: ignore[misc]
def _accumulate(view, body, samples, residuals, sums):  # type: ignore[no-untyped-def]
    """Sum one view's residuals per node of the body, into sums (m, SUMS)."""
    sums[:] = 0.0
    wrench = np.empty(6)
    for n in range(residuals.count[view]):
        s = residuals.sample[view, n]
        add_wrench(
            samples.world[view, s], residuals.gradient[view, n], residuals.weight[view, n],
            residuals.value[view, n], sums, body.cone_node[samples.cone[view, s]], wrench,
        )  # fmt: skip


@njit(cache=True, nogil=True)  # type: ignore[misc]
def _one_view(  # type: ignore[no-untyped-def]
    view, body, views, contours, spacing_m, step_px, reach_m, samples, residuals, scratch, outlines
):
    root = scratch.world[: 2 * LANES + 1 : LANES]
    r, t = views.rotation[view], views.translation[view]
    depth = r[2, 0] * root[0] + r[2, 1] * root[1] + r[2, 2] * root[2] + t[2]
    spacing_px = max(1.0, spacing_m * views.intrinsics[view, 0] / max(depth, 0.5))
    sample_outline(
        view, views, body.cone_node.size, spacing_px, step_px, scratch, outlines, samples
    )
    collect_residuals(
        view, views, contours, reach_m, samples, scratch.start[view], scratch.order[view], residuals
    )
    _accumulate(view, body, samples, residuals, scratch.sums[view])


@njit(cache=True, nogil=True)  # type: ignore[misc]
def _total(body, views, scratch):  # type: ignore[no-untyped-def]
    """Add up the views' sums, always in the same order, and fill the normal equations."""
    sums = scratch.sums[0]
    for view in range(1, views):
        for m in range(sums.shape[0]):
            for k in range(SUMS):
                sums[m, k] += scratch.sums[view, m, k]
    sum_chain(body, scratch.nodes, sums, scratch.hessian, scratch.slope)


@njit(cache=True, nogil=True)  # type: ignore[misc]
def equations_serial(  # type: ignore[no-untyped-def]
    pose, body, views, contours, spacing_m, step_px, reach_m, samples, residuals, scratch, outlines
):
    """Residuals and per-view normal equations at a pose (p,), on the calling thread."""
    cone_ends(pose, body, scratch.nodes, scratch.world)
    for view in range(views.size.shape[0]):
        _one_view(
            view, body, views, contours, spacing_m, step_px, reach_m, samples, residuals, scratch,
            outlines,
        )  # fmt: skip
    _total(body, views.size.shape[0], scratch)


@njit(cache=True, nogil=True, parallel=True)  # type: ignore[misc]
def equations_parallel(  # type: ignore[no-untyped-def]
    pose, body, views, contours, spacing_m, step_px, reach_m, samples, residuals, scratch, outlines
):
    """As `equations_serial`, a thread a view; each view sums for itself, so nothing changes."""
    cone_ends(pose, body, scratch.nodes, scratch.world)
    for view in prange(views.size.shape[0]):
        _one_view(
            view, body, views, contours, spacing_m, step_px, reach_m, samples, residuals, scratch,
            outlines,
        )  # fmt: skip
    _total(body, views.size.shape[0], scratch)
