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

from markerless_tracker.fitness.bits import is_set
from markerless_tracker.fitness.kernels import cone_ends, fill_outline, to_camera
from markerless_tracker.fitness.outline import (
    HIDDEN,
    MAX_POINTS,
    ONLY_END,
    TAPERED,
    cone_outline,
    cone_tangents,
    project_point,
)
from markerless_tracker.geometry import FloatArray

MAX_SAMPLES = 2048
"""Most outline points of the model in one view; later ones are not looked at."""


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
    world: FloatArray  # (c, 2, 3, 3)
    local: FloatArray  # (v, c, 2, 3, 3)
    rows: NDArray[np.uint64]  # (v, h, w), zero between calls
    left: FloatArray  # (v, h)
    right: FloatArray  # (v, h)
    points: FloatArray  # (v, MAX_POINTS, 2)
    hessian: FloatArray  # (v, p, p)
    slope: FloatArray  # (v, p)


def make_samples(views: int) -> Samples:
    """Allocate room for outline points."""
    s = (views, MAX_SAMPLES)
    return Samples(
        np.empty((*s, 2)), np.empty((*s, 2)), np.empty((*s, 3)), np.empty(s), np.empty(s),
        np.empty(s, dtype=np.int64), np.empty((*s, 5)), np.zeros(views, dtype=np.int64),
    )  # fmt: skip


def make_residuals(views: int, points: int) -> Residuals:
    """Allocate room for residuals: one per outline point and one per edge point."""
    s = (views, MAX_SAMPLES + points)
    return Residuals(
        np.empty(s), np.empty(s), np.empty((*s, 3)), np.empty(s, dtype=np.int64),
        np.zeros(views, dtype=np.int64), np.zeros(views),
    )  # fmt: skip


def make_contour_scratch(
    views: int, nodes: int, cones: int, parameters: int, height: int, words: int
) -> ContourScratch:
    """Allocate working memory."""
    return ContourScratch(
        np.empty((nodes, 3, 4)),
        np.empty((cones, 2, 3, 3)),
        np.empty((views, cones, 2, 3, 3)),
        np.zeros((views, height, words), dtype=np.uint64),
        np.empty((views, height)),
        np.empty((views, height)),
        np.empty((views, MAX_POINTS, 2)),
        np.empty((views, parameters, parameters)),
        np.empty((views, parameters)),
    )


@njit(cache=True, nogil=True)  # type: ignore[misc]
def _surface(ends, shape, out):  # type: ignore[no-untyped-def]
    """The surface point (3,) that a sample's shape (5,) stands for."""
    t = shape[4]
    for i in range(3):
        a = ends[0, 0, i] + shape[0] * ends[0, 1, i] + shape[1] * ends[0, 2, i]
        b = ends[1, 0, i] + shape[2] * ends[1, 1, i] + shape[3] * ends[1, 2, i]
        out[i] = (1.0 - t) * a + t * b


@njit(cache=True, nogil=True)  # type: ignore[misc]
def _add_sample(  # type: ignore[no-untyped-def]
    view,
    cone,
    world,
    local,
    k,
    distortion,
    distorted,
    nu,
    nv,
    length_px,
    step_px,
    width,
    height,
    rows,
    shape,
    samples,
):
    """Keep a point of one cone's outline if the pixel `step_px` outside it is free of the body."""
    n = samples.count[view]
    if n >= samples.cone.shape[1]:
        return
    p = np.empty(3)
    uv = np.empty((1, 2))
    _surface(local, shape, p)
    project_point(p[0], p[1], p[2], k, distortion, distorted, uv, 0)
    norm = np.sqrt(nu * nu + nv * nv)
    if not norm > 0.0:
        return
    nu, nv = nu / norm, nv / norm
    # Points outside the frame have no evidence.
    if not (
        uv[0, 0] >= 0.0 and uv[0, 1] >= 0.0 and uv[0, 0] <= width - 1.0 and uv[0, 1] <= height - 1.0
    ):
        return
    u = np.int64(np.floor(uv[0, 0] + step_px * nu + 0.5))
    v = np.int64(np.floor(uv[0, 1] + step_px * nv + 0.5))
    if 0 <= u < width and 0 <= v < height and is_set(rows, u, v):
        return
    samples.pixel[view, n, 0], samples.pixel[view, n, 1] = uv[0, 0], uv[0, 1]
    samples.normal[view, n, 0], samples.normal[view, n, 1] = nu, nv
    _surface(world, shape, samples.world[view, n])
    samples.depth[view, n] = p[2]
    samples.length[view, n] = length_px * p[2] / k[0]
    samples.cone[view, n] = cone
    for i in range(5):
        samples.shape[view, n, i] = shape[i]
    samples.count[view] = n + 1


@njit(cache=True, nogil=True)  # type: ignore[misc]
def sample_outline(view, views, spacing_px, step_px, scratch, samples):  # type: ignore[no-untyped-def]
    """Fill samples with the points of one view's outline of the whole body, `spacing_px` apart."""
    k = views.intrinsics[view]
    distortion = views.distortion[view]
    distorted = False
    for i in range(5):
        distorted = distorted or distortion[i] != 0.0
    width, height = views.size[view, 0], views.size[view, 1]
    local, rows, points = scratch.local[view], scratch.rows[view], scratch.points[view]
    used = np.empty(4, np.int64)
    used[0], used[1], used[2], used[3] = height, -1, rows.shape[1], -1
    sides = np.empty((3, 2, 2))
    flat = np.empty((2, 3, 2))
    arcs = np.empty((2, 5))
    to_camera(scratch.world, views.rotation[view], views.translation[view], local)
    for c in range(local.shape[0]):
        count = cone_outline(local[c], k, distortion, distorted, points, sides, flat, arcs)
        if count > 0:
            fill_outline(
                points, count, width, height, rows, scratch.left[view], scratch.right[view], used
            )

    shape = np.empty(5)
    p = np.empty(3)
    pair = np.empty((2, 2))
    samples.count[view] = 0
    for c in range(local.shape[0]):
        form = cone_tangents(local[c], flat, arcs)
        if form == HIDDEN:
            continue
        for e in range(2):
            if form != TAPERED and form != ONLY_END + e:
                continue
            radius = 0.0
            for m in range(1, 3):
                radius = max(radius, np.sqrt(flat[e, m, 0] ** 2 + flat[e, m, 1] ** 2))
            arc_px = radius * k[0] * abs(arcs[e, 4])
            n = np.int64(min(max(3.0, np.ceil(arc_px / spacing_px)), 200.0))
            shape[4] = e
            begin = np.arctan2(arcs[e, 1], arcs[e, 0])
            for i in range(n):
                angle = begin + arcs[e, 4] * (i + 0.5) / n
                cos, sin = np.cos(angle), np.sin(angle)
                shape[0], shape[1], shape[2], shape[3] = cos, sin, cos, sin
                # Along the arc, in the image; outward is across it, away from the middle.
                tu = k[0] * (cos * flat[e, 2, 0] - sin * flat[e, 1, 0])
                tv = k[3] * (cos * flat[e, 2, 1] - sin * flat[e, 1, 1])
                mu = k[0] * (cos * flat[e, 1, 0] + sin * flat[e, 2, 0])
                mv = k[3] * (cos * flat[e, 1, 1] + sin * flat[e, 2, 1])
                length = np.sqrt(tu * tu + tv * tv) * abs(arcs[e, 4]) / n
                nu, nv = tv, -tu
                if nu * mu + nv * mv < 0.0:
                    nu, nv = -nu, -nv
                _add_sample(
                    view, c, scratch.world[c], local[c], k, distortion, distorted, nu, nv, length,
                    step_px, width, height, rows, shape, samples,
                )  # fmt: skip
        if form != TAPERED:
            continue
        for side in range(2):
            # Side 0 ends end 0's arc and begins end 1's; side 1 the other way.
            at_0 = 2 if side == 0 else 0
            at_1 = 2 - at_0
            shape[0], shape[1] = arcs[0, at_0], arcs[0, at_0 + 1]
            shape[2], shape[3] = arcs[1, at_1], arcs[1, at_1 + 1]
            shape[4] = 0.0
            _surface(local[c], shape, p)
            z0 = p[2]
            project_point(p[0], p[1], p[2], k, distortion, distorted, pair, 0)
            shape[4] = 1.0
            _surface(local[c], shape, p)
            z1 = p[2]
            project_point(p[0], p[1], p[2], k, distortion, distorted, pair, 1)
            du, dv = pair[1, 0] - pair[0, 0], pair[1, 1] - pair[0, 1]
            length = np.sqrt(du * du + dv * dv)
            n = np.int64(min(max(1.0, np.ceil(length / spacing_px)), 400.0))
            nu, nv = (-dv, du) if side == 0 else (dv, -du)
            for i in range(n):
                s = (i + 0.5) / n
                # Equal steps in the image are not equal steps along the cone.
                shape[4] = s * z0 / (z1 * (1.0 - s) + s * z0)
                _add_sample(
                    view, c, scratch.world[c], local[c], k, distortion, distorted, nu, nv,
                    length / n, step_px, width, height, rows, shape, samples,
                )  # fmt: skip
    for v in range(used[0], used[1] + 1):
        for w in range(used[2], used[3] + 1):
            rows[v, w] = np.uint64(0)


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
def collect_residuals(view, views, contours, reach_m, samples, residuals):  # type: ignore[no-untyped-def]
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
    for m in range(contours.point_start[view], contours.point_start[view + 1]):
        u, v = contours.points[m, 0], contours.points[m, 1]
        nu, nv = contours.normals[m, 0], contours.normals[m, 1]
        best = np.inf
        nearest = -1
        for s in range(samples.count[view]):
            du, dv = samples.pixel[view, s, 0] - u, samples.pixel[view, s, 1] - v
            gap = du * du + dv * dv
            if gap < best:
                facing = samples.normal[view, s, 0] * nu + samples.normal[view, s, 1] * nv
                if facing > 0.5:
                    best = gap
                    nearest = s
        metres = 0.0
        if nearest >= 0:
            metres = samples.depth[view, nearest] / k[0]
        elif samples.count[view] > 0:
            metres = samples.depth[view, 0] / k[0]
        length = contours.spacing[m] * metres
        cost += length * limit
        if nearest < 0 or np.sqrt(best) * metres >= reach_m:
            continue
        du = samples.pixel[view, nearest, 0] - u
        dv = samples.pixel[view, nearest, 1] - v
        value = (du * nu + dv * nv) * metres
        share = 1.0 - best * metres * metres / (reach_m * reach_m)
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
def pose_row(point, gradient, node, body, nodes, index, row):  # type: ignore[no-untyped-def]
    """Derivatives of a residual by the parameters that move its point; returns how many.

    index and row (m,) are filled with the parameters and the derivatives: along the chain from the
    node up, a rotation about an axis w through o moves the point by w x (point - o).
    """
    n = 0
    while node >= 0:
        kind = body.kind[node]
        if kind >= 3:
            axis = kind - 3
            value = 0.0
            for i in range(3):
                value += nodes[node, i, axis] * gradient[i]
            index[n], row[n] = body.parameter[node], body.sign[node] * value
            n += 1
        elif kind >= 0:
            x = point[0] - nodes[node, 0, 3]
            y = point[1] - nodes[node, 1, 3]
            z = point[2] - nodes[node, 2, 3]
            value = (
                nodes[node, 0, kind] * (y * gradient[2] - z * gradient[1])
                + nodes[node, 1, kind] * (z * gradient[0] - x * gradient[2])
                + nodes[node, 2, kind] * (x * gradient[1] - y * gradient[0])
            )
            index[n], row[n] = body.parameter[node], body.sign[node] * value
            n += 1
        node = body.parent[node]
    return n


@njit(cache=True, nogil=True)  # type: ignore[misc]
def _accumulate(view, body, samples, residuals, scratch):  # type: ignore[no-untyped-def]
    """Sum one view's JᵀWJ and JᵀWr."""
    hessian, slope = scratch.hessian[view], scratch.slope[view]
    hessian[:] = 0.0
    slope[:] = 0.0
    index = np.empty(body.parent.size, np.int64)
    row = np.empty(body.parent.size)
    for n in range(residuals.count[view]):
        s = residuals.sample[view, n]
        moved = pose_row(
            samples.world[view, s], residuals.gradient[view, n],
            body.cone_node[samples.cone[view, s]], body, scratch.nodes, index, row,
        )  # fmt: skip
        weight, value = residuals.weight[view, n], residuals.value[view, n]
        for i in range(moved):
            scaled = weight * row[i]
            slope[index[i]] += scaled * value
            for j in range(moved):
                hessian[index[i], index[j]] += scaled * row[j]


@njit(cache=True, nogil=True)  # type: ignore[misc]
def _one_view(  # type: ignore[no-untyped-def]
    view, body, views, contours, spacing_m, step_px, reach_m, samples, residuals, scratch
):
    root = scratch.world[0, 0, 0]
    r, t = views.rotation[view], views.translation[view]
    depth = r[2, 0] * root[0] + r[2, 1] * root[1] + r[2, 2] * root[2] + t[2]
    spacing_px = max(1.0, spacing_m * views.intrinsics[view, 0] / max(depth, 0.5))
    sample_outline(view, views, spacing_px, step_px, scratch, samples)
    collect_residuals(view, views, contours, reach_m, samples, residuals)
    _accumulate(view, body, samples, residuals, scratch)


@njit(cache=True, nogil=True)  # type: ignore[misc]
def equations_serial(  # type: ignore[no-untyped-def]
    pose, body, views, contours, spacing_m, step_px, reach_m, samples, residuals, scratch
):
    """Residuals and per-view normal equations at a pose (p,), on the calling thread."""
    cone_ends(pose, body, scratch.nodes, scratch.world)
    for view in range(views.size.shape[0]):
        _one_view(
            view, body, views, contours, spacing_m, step_px, reach_m, samples, residuals, scratch
        )


@njit(cache=True, nogil=True, parallel=True)  # type: ignore[misc]
def equations_parallel(  # type: ignore[no-untyped-def]
    pose, body, views, contours, spacing_m, step_px, reach_m, samples, residuals, scratch
):
    """As `equations_serial`, a thread a view; each view sums for itself, so nothing changes."""
    cone_ends(pose, body, scratch.nodes, scratch.world)
    for view in prange(views.size.shape[0]):
        _one_view(
            view, body, views, contours, spacing_m, step_px, reach_m, samples, residuals, scratch
        )
