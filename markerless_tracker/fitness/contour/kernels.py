"""The compiled loops of contour refinement: a pose in, residuals and normal equations out.

Residuals are distances between two outlines, taken both ways and in metres at the body's depth:
outline points of the model to the silhouette's edge (its signed distance), and points of the
silhouette's edge to the nearest outline point of the model. Each carries the gradient with respect
to the 3D point on a cone's surface that makes it; the point moves rigidly with its cone, since
sliding along the surface does not move the outline to first order.
"""

from typing import NamedTuple

import numpy as np
from numba import prange
from numpy.typing import NDArray

from markerless_tracker.compiled import compiled, kernel
from markerless_tracker.fitness.contour.chain_kernels import SUMS, add_wrench, sum_chain
from markerless_tracker.fitness.contour.outline_samples import MAX_SAMPLES, sample_outline
from markerless_tracker.fitness.raster.kernels import cone_ends
from markerless_tracker.fitness.raster.outline import LANES
from markerless_tracker.geometry import FloatArray

BAND_PX = 8
"""Rows of a frame whose outline points are looked through together for the nearest."""

_SMOOTH = (1.0, 4.0, 6.0, 4.0, 1.0)
_RISE = (-1.0, -2.0, 0.0, 2.0, 1.0)


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


@kernel
def steepest(distance, pixels, out):  # type: ignore[no-untyped-def]
    """Fill out (n, 2): where distances (h, w) rise at pixels (n, 2), by Sobel's 5x5 px."""
    height, width = distance.shape
    for n in range(pixels.shape[0]):
        along_u, along_v = 0.0, 0.0
        for i in range(5):
            v = min(max(pixels[n, 1] + i - 2, 0), height - 1)
            for j in range(5):
                u = min(max(pixels[n, 0] + j - 2, 0), width - 1)
                along_u += _SMOOTH[i] * _RISE[j] * distance[v, u]
                along_v += _RISE[i] * _SMOOTH[j] * distance[v, u]
        out[n, 0], out[n, 1] = along_u, along_v


@kernel
def _distance_at(distance, start, left, top, width, height, u, v):  # type: ignore[no-untyped-def]
    """Bilinear signed distance, px, and its gradient; whether the pixel is inside the window."""
    x, y = u - left, v - top
    if not (x >= 0.0 and y >= 0.0 and x < width - 1.0 and y < height - 1.0):
        return False, 0.0, 0.0, 0.0
    i, j = np.int64(x), np.int64(y)
    fx, fy = x - i, y - j
    at = np.uint64(start + j * width + i)
    below = at + np.uint64(width)
    one = np.uint64(1)
    d00, d10 = np.float64(distance[at]), np.float64(distance[at + one])
    d01, d11 = np.float64(distance[below]), np.float64(distance[below + one])
    value = (d00 * (1 - fx) + d10 * fx) * (1 - fy) + (d01 * (1 - fx) + d11 * fx) * fy
    along_u = (d10 - d00) * (1 - fy) + (d11 - d01) * fy
    along_v = (d01 - d00) * (1 - fx) + (d11 - d10) * fx
    return True, value, along_u, along_v


@kernel
def _world_gradient(r, t, k, d, point, s, du, dv, out, n):  # type: ignore[no-untyped-def]
    """Fill out[n] (3,) with the gradient of du * u + dv * v with respect to world point[s].

    r, t, k, d: rotation, translation, intrinsics and lens of the view.
    """
    px, py, pz = point[s, 0], point[s, 1], point[s, 2]
    x = r[0, 0] * px + r[0, 1] * py + r[0, 2] * pz + t[0]
    y = r[1, 0] * px + r[1, 1] * py + r[1, 2] * pz + t[1]
    z = 1.0 / (r[2, 0] * px + r[2, 1] * py + r[2, 2] * pz + t[2])
    a, b = x * z, y * z
    r2 = a * a + b * b
    radial = 1.0 + r2 * (d[0] + r2 * (d[1] + r2 * d[4]))
    rate = 2.0 * (d[0] + r2 * (2.0 * d[1] + 3.0 * r2 * d[4]))
    aa = radial + a * a * rate + 2.0 * d[2] * b + 6.0 * d[3] * a
    ab = a * b * rate + 2.0 * d[2] * a + 2.0 * d[3] * b
    bb = radial + b * b * rate + 6.0 * d[2] * b + 2.0 * d[3] * a
    # d(u, v)/d(a, b), then d(a, b)/d(camera point), then to the world's axes.
    ga = du * (k[0] * aa + k[1] * ab) + dv * k[3] * ab
    gb = du * (k[0] * ab + k[1] * bb) + dv * k[3] * bb
    gx, gy = ga * z, gb * z
    gz = -(ga * a + gb * b) * z
    for i in range(3):
        out[n, i] = gx * r[0, i] + gy * r[1, i] + gz * r[2, i]


@kernel
def sort_into_bands(count, height, pixel, start, order):  # type: ignore[no-untyped-def]
    """Sort outline points, pixel (s, 2), into bands of BAND_PX rows; returns the number of bands.

    Band b holds the points order[start[b] : start[b + 1]].
    """
    bands = height // BAND_PX + 1
    for b in range(bands + 1):
        start[b] = 0
    for s in range(count):
        start[int(pixel[s, 1]) // BAND_PX + 1] += 1
    for b in range(bands):
        start[b + 1] += start[b]
    for s in range(count - 1, -1, -1):
        b = int(pixel[s, 1]) // BAND_PX + 1
        start[b] -= 1
        order[start[b]] = s
    # Each start has moved down to where its band begins, one place too far to the right.
    for b in range(bands):
        start[b] = start[b + 1]
    start[bands] = count
    return bands


@kernel
def _nearest(u, v, nu, nv, bands, pixel, normal, start, order):  # type: ignore[no-untyped-def]
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
                s = np.uint64(order[i])
                du, dv = pixel[s, 0] - u, pixel[s, 1] - v
                gap = du * du + dv * dv
                if gap < best and normal[s, 0] * nu + normal[s, 1] * nv > 0.5:
                    best = gap
                    nearest = order[i]
    return nearest


@kernel
def collect_residuals(view, views, contours, truncation_m, samples, start, order, residuals):  # type: ignore[no-untyped-def]
    """Fill the residuals of one view, both ways.

    With c the truncation, robust weights are Tukey's, (1 - (r / c)²)², and the cost is
    c² / 6 (1 - (1 - (r / c)²)³).
    """
    r, t = views.rotation[view], views.translation[view]
    k, d = views.intrinsics[view], views.distortion[view]
    pixel, normal, world = samples.pixel[view], samples.normal[view], samples.world[view]
    depth, lengths, count = samples.depth[view], samples.length[view], samples.count[view]
    values, weights = residuals.value[view], residuals.weight[view]
    gradient, sample = residuals.gradient[view], residuals.sample[view]
    distance, distance_start = contours.distance, contours.distance_start[view]
    left, top = contours.window[view, 0], contours.window[view, 1]
    width, height = contours.window[view, 2], contours.window[view, 3]
    n = 0
    cost = 0.0
    limit = truncation_m * truncation_m / 6.0
    focal = 1.0 / k[0]
    for s in range(count):
        metres = depth[s] * focal
        length = lengths[s]
        cost += length * limit
        inside, value, along_u, along_v = _distance_at(
            distance, distance_start, left, top, width, height, pixel[s, 0], pixel[s, 1]
        )
        value *= metres
        if not inside or abs(value) >= truncation_m:
            continue
        steep = np.sqrt(along_u * along_u + along_v * along_v)
        facing = along_u * normal[s, 0] + along_v * normal[s, 1]
        if steep < 0.3 or facing < 0.5 * steep:
            continue
        share = 1.0 - (value / truncation_m) ** 2
        cost -= length * limit * share**3
        values[n] = value
        weights[n] = length * share * share
        sample[n] = s
        _world_gradient(r, t, k, d, world, s, metres * along_u, metres * along_v, gradient, n)
        n += 1
    bands = sort_into_bands(count, views.size[view, 1], pixel, start, order)
    points, normals, spacing = contours.points, contours.normals, contours.spacing
    for m in range(contours.point_start[view], contours.point_start[view + 1]):
        u, v = points[m, 0], points[m, 1]
        nu, nv = normals[m, 0], normals[m, 1]
        nearest = _nearest(u, v, nu, nv, bands, pixel, normal, start, order)
        metres = 0.0
        if nearest >= 0:
            metres = depth[nearest] * focal
        elif count > 0:
            metres = depth[0] * focal
        length = spacing[m] * metres
        cost += length * limit
        if nearest < 0:
            continue
        du, dv = pixel[nearest, 0] - u, pixel[nearest, 1] - v
        gap = (du * du + dv * dv) * metres * metres
        if gap >= truncation_m * truncation_m:
            continue
        share = 1.0 - gap / (truncation_m * truncation_m)
        cost -= length * limit * share**3
        values[n] = (du * nu + dv * nv) * metres
        weights[n] = length * share * share
        sample[n] = nearest
        _world_gradient(r, t, k, d, world, nearest, metres * nu, metres * nv, gradient, n)
        n += 1
    residuals.count[view] = n
    residuals.cost[view] = cost


@kernel
def _accumulate(view, cone_node, samples, residuals, sums):  # type: ignore[no-untyped-def]
    """Sum one view's residuals per node of the body, into sums (m, SUMS)."""
    for m in range(sums.shape[0]):
        for k in range(SUMS):
            sums[m, k] = 0.0
    world, cone = samples.world[view], samples.cone[view]
    gradient, sample = residuals.gradient[view], residuals.sample[view]
    weight, value = residuals.weight[view], residuals.value[view]
    for n in range(residuals.count[view]):
        s = sample[n]
        add_wrench(
            world[s, 0], world[s, 1], world[s, 2], gradient[n, 0], gradient[n, 1], gradient[n, 2],
            weight[n], value[n], sums, cone_node[cone[s]],
        )  # fmt: skip


@kernel
def _one_view(  # type: ignore[no-untyped-def]
    view,
    body,
    views,
    contours,
    spacing_m,
    step_px,
    truncation_m,
    samples,
    residuals,
    scratch,
    outlines,
):  # fmt: skip
    world = scratch.world
    r, t = views.rotation[view], views.translation[view]
    depth = r[2, 0] * world[0] + r[2, 1] * world[LANES] + r[2, 2] * world[2 * LANES] + t[2]
    spacing_px = max(1.0, spacing_m * views.intrinsics[view, 0] / max(depth, 0.5))
    sample_outline(
        view, views, body.cone_node.size, spacing_px, step_px, scratch, outlines, samples
    )
    collect_residuals(
        view,
        views,
        contours,
        truncation_m,
        samples,
        scratch.start[view],
        scratch.order[view],
        residuals,
    )
    _accumulate(view, body.cone_node, samples, residuals, scratch.sums[view])


@compiled()
def _total(body, views, scratch):  # type: ignore[no-untyped-def]
    """Add up the views' sums, always in the same order, and fill the normal equations."""
    sums = scratch.sums[0]
    for view in range(1, views):
        for m in range(sums.shape[0]):
            for k in range(SUMS):
                sums[m, k] += scratch.sums[view, m, k]
    sum_chain(body, scratch.nodes, sums, scratch.hessian, scratch.slope)


@compiled()
def equations_serial(  # type: ignore[no-untyped-def]
    pose,
    body,
    views,
    contours,
    spacing_m,
    step_px,
    truncation_m,
    samples,
    residuals,
    scratch,
    outlines,
):  # fmt: skip
    """Residuals and per-view normal equations at a pose (p,), on the calling thread."""
    cone_ends(pose, body, scratch.nodes, scratch.world)
    for view in range(views.size.shape[0]):
        _one_view(
            view, body, views, contours, spacing_m, step_px, truncation_m, samples, residuals,
            scratch, outlines,
        )  # fmt: skip
    _total(body, views.size.shape[0], scratch)


@compiled(parallel=True)
def equations_parallel(  # type: ignore[no-untyped-def]
    pose,
    body,
    views,
    contours,
    spacing_m,
    step_px,
    truncation_m,
    samples,
    residuals,
    scratch,
    outlines,
):  # fmt: skip
    """As `equations_serial`, a thread a view; each view sums for itself, so nothing changes."""
    cone_ends(pose, body, scratch.nodes, scratch.world)
    for view in prange(views.size.shape[0]):
        _one_view(
            view, body, views, contours, spacing_m, step_px, truncation_m, samples, residuals,
            scratch, outlines,
        )  # fmt: skip
    _total(body, views.size.shape[0], scratch)
