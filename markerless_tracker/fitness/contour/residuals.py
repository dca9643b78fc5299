"""Distances between the outlines of the model and of the silhouettes, in both directions.

Residuals are the signed distances of the model's outline points from the silhouette's edge, and for
points of the edge their distances, along the edge's normal, from the nearest outline point of the
model, in metres at the body's depth. Each has a gradient with respect to a point of a cone's
surface (docs/normal-equations.md).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.compiled import kernel
from markerless_tracker.fitness.contour.nearest import nearest_facing, sort_into_bands
from markerless_tracker.fitness.contour.outline_samples import MAX_SAMPLES
from markerless_tracker.geometry import FloatArray


class Residuals(NamedTuple):
    """Residuals of v views, at most s per view.

    Attributes:
        value: (v, s) m.
        weight: (v, s) represented length of outline (m) times the robust weight.
        sample: (v, s) index of the outline point among the view's.
        world: (v, 3, s) that point, m.
        pixel_gradient: (v, 2, s) with respect to its pixel, m / px.
        gradient: (v, 3, s) with respect to the point.
        count: (v,).
        cost: (v,) sum of length times the robust cost, m³.
    """

    value: FloatArray
    weight: FloatArray
    sample: NDArray[np.int64]
    world: FloatArray
    pixel_gradient: FloatArray
    gradient: FloatArray
    count: NDArray[np.int64]  # type: ignore[assignment]
    cost: FloatArray


def make_residuals(views: int, points: int) -> Residuals:
    """Allocate the arrays for residuals: one per outline point and one per edge point."""
    most = MAX_SAMPLES + points
    s = (views, most)
    return Residuals(
        np.empty(s), np.empty(s), np.empty(s, dtype=np.int64), np.empty((views, 3, most)),
        np.empty((views, 2, most)), np.empty((views, 3, most)), np.zeros(views, dtype=np.int64),
        np.zeros(views),
    )  # fmt: skip


@kernel
def _distance_at(distance, start, left, top, width, height, u, v):  # type: ignore[no-untyped-def]
    """Whether a pixel is inside the window; its bilinear signed distance, px, and the gradient."""
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
def _world_gradients(count, r, t, k, d, world, pixel_gradient, out):  # type: ignore[no-untyped-def]
    """Fill out (3, s) with gradients with respect to world points.

    Args:
        count: number of residuals.
        r, t, k, d: rotation, translation, intrinsics and lens of the view.
        world: (3, s) the points.
        pixel_gradient: (2, s) the gradients with respect to their pixels.
    """
    r00, r01, r02 = r[0, 0], r[0, 1], r[0, 2]
    r10, r11, r12 = r[1, 0], r[1, 1], r[1, 2]
    r20, r21, r22 = r[2, 0], r[2, 1], r[2, 2]
    t0, t1, t2 = t[0], t[1], t[2]
    k0, k1, k3 = k[0], k[1], k[3]
    d0, d1, d2, d3, d4 = d[0], d[1], d[2], d[3], d[4]
    # Rows of their own, whose elements the compiler knows to be adjacent.
    xs, ys, zs = world[0], world[1], world[2]
    by_u, by_v = pixel_gradient[0], pixel_gradient[1]
    for n in range(count):
        px, py, pz, du, dv = xs[n], ys[n], zs[n], by_u[n], by_v[n]
        x = r00 * px + r01 * py + r02 * pz + t0
        y = r10 * px + r11 * py + r12 * pz + t1
        inverse_depth = 1.0 / (r20 * px + r21 * py + r22 * pz + t2)
        a, b = x * inverse_depth, y * inverse_depth
        r2 = a * a + b * b
        radial = 1.0 + r2 * (d0 + r2 * (d1 + r2 * d4))
        rate = 2.0 * (d0 + r2 * (2.0 * d1 + 3.0 * r2 * d4))
        aa = radial + a * a * rate + 2.0 * d2 * b + 6.0 * d3 * a
        ab = a * b * rate + 2.0 * d2 * a + 2.0 * d3 * b
        bb = radial + b * b * rate + 6.0 * d2 * b + 2.0 * d3 * a
        # d(u, v)/d(a, b), then d(a, b)/d(camera point), then in the world's axes.
        ga = du * (k0 * aa + k1 * ab) + dv * k3 * ab
        gb = du * (k0 * ab + k1 * bb) + dv * k3 * bb
        gx, gy = ga * inverse_depth, gb * inverse_depth
        gz = -(ga * a + gb * b) * inverse_depth
        out[0, n] = gx * r00 + gy * r10 + gz * r20
        out[1, n] = gx * r01 + gy * r11 + gz * r21
        out[2, n] = gx * r02 + gy * r12 + gz * r22


@kernel
def collect_residuals(view, views, contours, truncation_m, samples, bands, residuals):  # type: ignore[no-untyped-def]
    """Fill the residuals of one view, in both directions.

    With the truncation c, robust weights are Tukey's, (1 - (r / c)²)², and the cost is
    c² / 6 (1 - (1 - (r / c)²)³). For points of the edge, r in both is the whole distance to the
    model's point, not the one along the normal.
    """
    r, t = views.rotation[view], views.translation[view]
    k, d = views.intrinsics[view], views.distortion[view]
    pixel, normal, point = samples.pixel[view], samples.normal[view], samples.world[view]
    depth, lengths, count = samples.depth[view], samples.length[view], samples.count[view]
    values, weights = residuals.value[view], residuals.weight[view]
    sample, world = residuals.sample[view], residuals.world[view]
    pixel_gradient = residuals.pixel_gradient[view]
    distance, distance_start = contours.distance, contours.distance_start[view]
    left, top = contours.window[view, 0], contours.window[view, 1]
    width, height = contours.window[view, 2], contours.window[view, 3]
    n = np.int64(0)
    cost = 0.0
    outlier_cost = truncation_m * truncation_m / 6.0
    inverse_focal = 1.0 / k[0]
    least_depth = np.inf
    for s in range(count):
        m_per_px = depth[s] * inverse_focal
        least_depth = min(least_depth, depth[s])
        length = lengths[s]
        cost += length * outlier_cost
        inside, value, along_u, along_v = _distance_at(
            distance, distance_start, left, top, width, height, pixel[s, 0], pixel[s, 1]
        )
        value *= m_per_px
        if not inside or abs(value) >= truncation_m:
            continue
        steep = np.sqrt(along_u * along_u + along_v * along_v)
        facing = along_u * normal[s, 0] + along_v * normal[s, 1]
        if steep < 0.3 or facing < 0.5 * steep:
            continue
        share = 1.0 - (value / truncation_m) ** 2
        cost -= length * outlier_cost * share**3
        values[n] = value
        weights[n] = length * share * share
        sample[n] = s
        for i in range(3):
            world[i, n] = point[s, i]
        pixel_gradient[0, n], pixel_gradient[1, n] = m_per_px * along_u, m_per_px * along_v
        n += 1
    # No point farther off than this radius lies within the truncation.
    radius_px = truncation_m / (least_depth * inverse_focal)
    start, order, sorted_points = bands.start[view], bands.order[view], bands.points[view]
    number = sort_into_bands(count, views.size[view, 1], pixel, normal, start, order, sorted_points)
    points, normals, spacing = contours.points, contours.normals, contours.spacing
    first_m = depth[0] * inverse_focal if count > 0 else 0.0
    for m in range(contours.point_start[view], contours.point_start[view + 1]):
        u, v = points[m, 0], points[m, 1]
        nu, nv = normals[m, 0], normals[m, 1]
        nearest = nearest_facing(
            u, v, nu, nv, radius_px * radius_px, number, start, order, sorted_points
        )
        m_per_px, gap = 0.0, np.inf
        if nearest >= 0:
            m_per_px = depth[nearest] * inverse_focal
            du, dv = pixel[nearest, 0] - u, pixel[nearest, 1] - v
            gap = (du * du + dv * dv) * m_per_px * m_per_px
        if gap >= truncation_m * truncation_m:
            # The length of an outlier is taken at the depth of the body's first point.
            cost += spacing[m] * first_m * outlier_cost
            continue
        length = spacing[m] * m_per_px
        cost += length * outlier_cost
        share = 1.0 - gap / (truncation_m * truncation_m)
        cost -= length * outlier_cost * share**3
        values[n] = (du * nu + dv * nv) * m_per_px
        weights[n] = length * share * share
        sample[n] = nearest
        for i in range(3):
            world[i, n] = point[nearest, i]
        pixel_gradient[0, n], pixel_gradient[1, n] = m_per_px * nu, m_per_px * nv
        n += 1
    _world_gradients(n, r, t, k, d, world, pixel_gradient, residuals.gradient[view])
    residuals.count[view] = n
    residuals.cost[view] = cost
