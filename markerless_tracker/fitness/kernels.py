"""The compiled loops of the fitness: poses in, overlap counts and edge sums out.

One particle is one piece of work: kinematics once, then every view. Cones are filled as spans of
bits into a frame-sized buffer of the working thread, which is counted against the observed
silhouette and wiped on the way out, so nothing is allocated per particle. A result depends on its
particle alone, hence not on the number of threads.
"""

from typing import NamedTuple

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from markerless_tracker.body.kinematics import node_transforms
from markerless_tracker.fitness.bits import is_set, popcount, set_span
from markerless_tracker.fitness.outline import MAX_POINTS, cone_outline
from markerless_tracker.geometry import FloatArray

OVERLAP, PROJECTED, EDGE_SUM, EDGE_COUNT = 0, 1, 2, 3
"""Columns of the counts: Y, Y + B, sum of (1 - M)² or of M over the edge samples, their number."""

SIDES, VISIBLE, OUTLINE = 0, 1, 2
"""Which model edges are sampled: all sides; those no nearer cone hides; the body's outline only."""


class EdgeRule(NamedTuple):
    """How edges are sampled: rule, spacing and outward step in px, whether costs are squared."""

    rule: int
    spacing_px: float
    step_px: float
    squared: bool


class Scratch(NamedTuple):
    """Working memory of t threads, for m nodes, c cones and frames of h rows of w words."""

    rows: NDArray[np.uint64]  # (t, h, w), all zero between calls
    left: FloatArray  # (t, h)
    right: FloatArray  # (t, h)
    nodes: FloatArray  # (t, m, 3, 4)
    world: FloatArray  # (t, c, 2, 3, 3)
    local: FloatArray  # (t, c, 2, 3, 3)
    points: FloatArray  # (t, MAX_POINTS, 2)
    sides: FloatArray  # (t, c, 3, 2, 2)
    order: NDArray[np.int64]  # (t, c)
    flat: FloatArray  # (t, 2, 3, 2)
    arcs: FloatArray  # (t, 2, 5)


def make_scratch(threads: int, nodes: int, cones: int, height: int, words: int) -> Scratch:
    """Allocate working memory for a number of threads."""
    return Scratch(
        np.zeros((threads, height, words), dtype=np.uint64),
        np.empty((threads, height)),
        np.empty((threads, height)),
        np.empty((threads, nodes, 3, 4)),
        np.empty((threads, cones, 2, 3, 3)),
        np.empty((threads, cones, 2, 3, 3)),
        np.empty((threads, MAX_POINTS, 2)),
        np.empty((threads, cones, 3, 2, 2)),
        np.empty((threads, cones), dtype=np.int64),
        np.empty((threads, 2, 3, 2)),
        np.empty((threads, 2, 5)),
    )


@njit(cache=True, nogil=True)  # type: ignore[misc]
def cone_ends(pose, body, nodes, world):  # type: ignore[no-untyped-def]
    """Fill world (c, 2, 3, 3): per cone and end its centre and its two radius vectors."""
    node_transforms(pose, body.parent, body.fixed, body.kind, body.sign, body.parameter, nodes)
    for c in range(body.cone_node.size):
        node = nodes[body.cone_node[c]]
        fixed = body.cone_fixed[c]
        for e in range(2):
            rx, ry = body.cone_shape[c, e, 0], body.cone_shape[c, e, 1]
            ox, oy = body.cone_shape[c, e, 2], body.cone_shape[c, e, 3]
            oz = body.cone_length[c] * e
            for i in range(3):
                world[c, e, 0, i] = node[i, 3]
                world[c, e, 1, i] = 0.0
                world[c, e, 2, i] = 0.0
            for m in range(3):
                centre = fixed[m, 0] * ox + fixed[m, 1] * oy + fixed[m, 2] * oz + fixed[m, 3]
                a, b = fixed[m, 0] * rx, fixed[m, 1] * ry
                for i in range(3):
                    world[c, e, 0, i] += node[i, m] * centre
                    world[c, e, 1, i] += node[i, m] * a
                    world[c, e, 2, i] += node[i, m] * b


@njit(cache=True, nogil=True)  # type: ignore[misc]
def to_camera(world, rotation, translation, local):  # type: ignore[no-untyped-def]
    """Cone ends (c, 2, 3, 3) of the world in a camera's frame."""
    for c in range(world.shape[0]):
        for e in range(2):
            for i in range(3):
                r0, r1, r2 = rotation[i, 0], rotation[i, 1], rotation[i, 2]
                for m in range(3):
                    local[c, e, m, i] = (
                        r0 * world[c, e, m, 0] + r1 * world[c, e, m, 1] + r2 * world[c, e, m, 2]
                    )
                local[c, e, 0, i] += translation[i]


@njit(cache=True, nogil=True)  # type: ignore[misc]
def fill_outline(points, count, width, height, rows, left, right, used):  # type: ignore[no-untyped-def]
    """Set the pixels whose centres lie inside a convex polygon; widens used (4,).

    used: first row, last row, first word, last word that hold bits.
    """
    top, bottom = np.inf, -np.inf
    for i in range(count):
        top = min(top, points[i, 1])
        bottom = max(bottom, points[i, 1])
    if not (top <= height - 1 and bottom >= 0.0):
        return
    first = np.int64(np.ceil(max(top, 0.0)))
    last = np.int64(np.ceil(min(bottom, np.float64(height)))) - 1
    if first > last:
        return
    pu, pv = points[count - 1, 0], points[count - 1, 1]
    for i in range(count):
        qu, qv = points[i, 0], points[i, 1]
        # Rows in [lower, upper) cross this edge; half-open, so a vertex counts once a side.
        if qv > pv:
            start = np.int64(np.ceil(min(max(pv, 0.0), np.float64(height))))
            stop = np.int64(np.ceil(min(max(qv, 0.0), np.float64(height))))
            if start < stop:
                slope = (qu - pu) / (qv - pv)
                u = pu + slope * (start - pv)
                for v in range(start, stop):
                    left[v] = u
                    u += slope
        elif qv < pv:
            start = np.int64(np.ceil(min(max(qv, 0.0), np.float64(height))))
            stop = np.int64(np.ceil(min(max(pv, 0.0), np.float64(height))))
            if start < stop:
                slope = (pu - qu) / (pv - qv)
                u = qu + slope * (start - qv)
                for v in range(start, stop):
                    right[v] = u
                    u += slope
        pu, pv = qu, qv
    for v in range(first, last + 1):
        low = min(left[v], right[v])
        high = max(left[v], right[v])
        if not (high >= 0.0 and low <= width - 1.0):
            continue
        a = np.int64(np.ceil(max(low, 0.0)))
        b = np.int64(np.floor(min(high, width - 1.0)))
        if a > b:
            continue
        set_span(rows[v], a, b)
        used[2] = min(used[2], a >> 6)
        used[3] = max(used[3], b >> 6)
    used[0] = min(used[0], first)
    used[1] = max(used[1], last)


@njit(cache=True, nogil=True)  # type: ignore[misc]
def sample_side(p, q, outward, rows, edges, width, height, rule, counts):  # type: ignore[no-untyped-def]
    """Add the edge map along the segment p to q (2,) to counts.

    Args:
        outward: +1 or -1, the side of the segment that faces away from its cone.
        rows: bits that hide a sample: nearer cones (VISIBLE) or the whole body (OUTLINE).
        edges: (height * width,) uint8 edge map.
        counts: (4,) EDGE_SUM and EDGE_COUNT are added to.
    """
    du, dv = q[0] - p[0], q[1] - p[1]
    length = np.sqrt(du * du + dv * dv)
    if not (length > 0.0 and length < 1e6):
        return
    samples = np.int64(max(4.0, length / rule.spacing_px))
    step = outward * rule.step_px / length
    for i in range(samples):
        t = (i + 0.5) / samples
        u = p[0] + t * du
        v = p[1] + t * dv
        if not (u >= -0.5 and v >= -0.5 and u < width - 0.5 and v < height - 0.5):
            continue
        column, row = np.int64(u + 0.5), np.int64(v + 0.5)
        if rule.rule == VISIBLE:
            if is_set(rows, column, row):
                continue
        elif rule.rule == OUTLINE:
            out_u = np.int64(np.floor(u - step * dv + 0.5))
            out_v = np.int64(np.floor(v + step * du + 0.5))
            if 0 <= out_u < width and 0 <= out_v < height and is_set(rows, out_u, out_v):
                continue
        strength = edges[row * width + column] * (1.0 / 255.0)
        if rule.squared:
            counts[EDGE_SUM] += (1.0 - strength) * (1.0 - strength)
        else:
            counts[EDGE_SUM] += strength
        counts[EDGE_COUNT] += 1.0


@njit(cache=True, nogil=True)  # type: ignore[misc]
def _sample_cone(  # type: ignore[no-untyped-def]
    sides, wanted, rows, edges, width, height, rule, counts
):
    """Sample the sides of one cone, and its far end's edge, where wanted (2,)."""
    if wanted[0]:
        sample_side(sides[0, 0], sides[0, 1], 1.0, rows, edges, width, height, rule, counts)
        sample_side(sides[1, 0], sides[1, 1], -1.0, rows, edges, width, height, rule, counts)
    if wanted[1]:
        sample_side(sides[2, 0], sides[2, 1], 1.0, rows, edges, width, height, rule, counts)


@njit(cache=True, nogil=True)  # type: ignore[misc]
def compare_view(  # type: ignore[no-untyped-def]
    body_cones, edge_cones, views, view, rule, scratch, thread, counts
):
    """Compare the cones in `scratch.local` (a camera's frame) with that camera's view.

    Args:
        body_cones: (c,) cones that make the silhouette.
        edge_cones: (c, 2) whether the sides, and the far edge, of a cone are sampled.
        counts: (4,) filled: OVERLAP, PROJECTED, EDGE_SUM, EDGE_COUNT.
    """
    local, sides, order = scratch.local[thread], scratch.sides[thread], scratch.order[thread]
    rows, left, right = scratch.rows[thread], scratch.left[thread], scratch.right[thread]
    points, flat, arcs = scratch.points[thread], scratch.flat[thread], scratch.arcs[thread]
    width, height = views.size[view, 0], views.size[view, 1]
    words = views.words[view]
    edges = views.edges[views.edge_start[view] : views.edge_start[view] + width * height]
    mask = views.mask[views.mask_start[view] : views.mask_start[view] + words * height]
    distortion = views.distortion[view]
    distorted = False
    for i in range(5):
        distorted = distorted or distortion[i] != 0.0
    used = np.empty(4, np.int64)
    used[0], used[1], used[2], used[3] = height, -1, words, -1
    for i in range(4):
        counts[i] = 0.0

    n_cones = local.shape[0]
    for c in range(n_cones):
        order[c] = c
    if rule.rule == VISIBLE:
        # Nearest first, by the cones' middles: what is filled so far hides what comes.
        for i in range(1, n_cones):
            c = order[i]
            depth = local[c, 0, 0, 2] + local[c, 1, 0, 2]
            j = i - 1
            while j >= 0 and local[order[j], 0, 0, 2] + local[order[j], 1, 0, 2] > depth:
                order[j + 1] = order[j]
                j -= 1
            order[j + 1] = c
    for i in range(n_cones):
        c = order[i]
        sampled = edge_cones[c, 0] or edge_cones[c, 1]
        if not (body_cones[c] or sampled):
            continue
        count = cone_outline(
            local[c], views.intrinsics[view], distortion, distorted, points, sides[c], flat, arcs
        )
        if count == 0:
            for s in range(3):
                sides[c, s, 0, 0] = np.nan
            continue
        if sampled and rule.rule != OUTLINE:
            _sample_cone(sides[c], edge_cones[c], rows, edges, width, height, rule, counts)
        if body_cones[c]:
            fill_outline(points, count, width, height, rows, left, right, used)
    if rule.rule == OUTLINE:
        for c in range(n_cones):
            if edge_cones[c, 0] or edge_cones[c, 1]:
                _sample_cone(sides[c], edge_cones[c], rows, edges, width, height, rule, counts)

    overlap = np.uint64(0)
    projected = np.uint64(0)
    for v in range(used[0], used[1] + 1):
        start = np.uint64(v * words)
        for k in range(used[2], used[3] + 1):
            word = rows[np.uint64(v), np.uint64(k)]
            overlap += popcount(word & mask[start + np.uint64(k)])
            projected += popcount(word)
            rows[np.uint64(v), np.uint64(k)] = np.uint64(0)
    counts[OVERLAP] = overlap
    counts[PROJECTED] = projected


@njit(cache=True, nogil=True)  # type: ignore[misc]
def _work(poses, body, views, body_cones, edge_cones, rule, scratch, counts, thread, threads):  # type: ignore[no-untyped-def]
    """Evaluate every `threads`-th pose, from pose `thread` on."""
    for n in range(thread, poses.shape[0], threads):
        finite = True
        for i in range(poses.shape[1]):
            finite = finite and np.isfinite(poses[n, i])
        if not finite:
            counts[n, :, :] = np.nan
            continue
        cone_ends(poses[n], body, scratch.nodes[thread], scratch.world[thread])
        for view in range(views.size.shape[0]):
            to_camera(
                scratch.world[thread], views.rotation[view], views.translation[view],
                scratch.local[thread],
            )  # fmt: skip
            compare_view(
                body_cones, edge_cones, views, view, rule, scratch, thread, counts[n, view]
            )


@njit(cache=True, nogil=True)  # type: ignore[misc]
def count_serial(poses, body, views, body_cones, edge_cones, rule, scratch, counts):  # type: ignore[no-untyped-def]
    """Fill counts (n, v, 4) for poses (n, p) on the calling thread; NaN for non-finite poses."""
    _work(poses, body, views, body_cones, edge_cones, rule, scratch, counts, 0, 1)


@njit(cache=True, nogil=True, parallel=True)  # type: ignore[misc]
def count_parallel(poses, body, views, body_cones, edge_cones, rule, scratch, counts):  # type: ignore[no-untyped-def]
    """As `count_serial`, on as many threads as the scratch memory is for."""
    threads = scratch.rows.shape[0]
    for thread in prange(threads):
        _work(poses, body, views, body_cones, edge_cones, rule, scratch, counts, thread, threads)
