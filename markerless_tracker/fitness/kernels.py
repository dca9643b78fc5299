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
from markerless_tracker.fitness.bits import is_set
from markerless_tracker.fitness.fill import clear_used, count_and_wipe, fill_outline
from markerless_tracker.fitness.outline import (
    ARC_POINTS,
    HIDDEN,
    LANES,
    TAPERED,
    find_outlines,
    outlines_of,
)
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

    bits: NDArray[np.uint64]  # (t, w * h), all zero between calls
    used: NDArray[np.int64]  # (t, w, 2)
    nodes: FloatArray  # (t, m, 3, 4)
    world: FloatArray  # (t, 18 * LANES), rows as of Outlines.ends
    order: NDArray[np.int64]  # (t, c)


def make_scratch(threads: int, nodes: int, cones: int, height: int, words: int) -> Scratch:
    """Allocate working memory for a number of threads."""
    return Scratch(
        np.zeros((threads, words * height), dtype=np.uint64),
        np.empty((threads, words, 2), dtype=np.int64),
        np.empty((threads, nodes, 3, 4)),
        np.ones((threads, 18 * LANES)),
        np.empty((threads, cones), dtype=np.int64),
    )


@njit(cache=True, nogil=True, error_model="numpy")  # type: ignore[misc]
def cone_ends(pose, body, nodes, world):  # type: ignore[no-untyped-def]
    """Fill world (18 rows): per cone and end its centre and its two radius vectors, m."""
    node_transforms(pose, body.parent, body.fixed, body.kind, body.sign, body.parameter, nodes)
    for c in range(body.cone_node.size):
        node = body.cone_node[c]
        for i in range(3):
            n0, n1, n2 = nodes[node, i, 0], nodes[node, i, 1], nodes[node, i, 2]
            fixed = body.cone_fixed
            x = n0 * fixed[c, 0, 0] + n1 * fixed[c, 1, 0] + n2 * fixed[c, 2, 0]
            y = n0 * fixed[c, 0, 1] + n1 * fixed[c, 1, 1] + n2 * fixed[c, 2, 1]
            z = n0 * fixed[c, 0, 2] + n1 * fixed[c, 1, 2] + n2 * fixed[c, 2, 2]
            t = n0 * fixed[c, 0, 3] + n1 * fixed[c, 1, 3] + n2 * fixed[c, 2, 3] + nodes[node, i, 3]
            for e in range(2):
                at = (9 * e + i) * LANES + c
                rx, ry = body.cone_shape[c, e, 0], body.cone_shape[c, e, 1]
                ox, oy = body.cone_shape[c, e, 2], body.cone_shape[c, e, 3]
                world[at] = x * ox + y * oy + z * (body.cone_length[c] * e) + t
                world[at + 3 * LANES] = x * rx
                world[at + 6 * LANES] = y * ry


@njit(cache=True, nogil=True, error_model="numpy")  # type: ignore[misc]
def sample_side(  # type: ignore[no-untyped-def]
    pu, pv, qu, qv, outward, bits, edges, width, height, rule, counts
):
    """Add the edge map along the segment (pu, pv) to (qu, qv) to counts.

    Args:
        outward: +1 or -1, the side of the segment that faces away from its cone.
        bits: what hides a sample: nearer cones (VISIBLE) or the whole body (OUTLINE).
        edges: (height * width,) uint8 edge map.
        counts: (4,) EDGE_SUM and EDGE_COUNT are added to.
    """
    du, dv = qu - pu, qv - pv
    length = np.sqrt(du * du + dv * dv)
    if not (length > 0.0 and length < 1e6):
        return
    samples = np.int64(max(4.0, length / rule.spacing_px))
    step = outward * rule.step_px / length
    for i in range(samples):
        t = (i + 0.5) / samples
        u = pu + t * du
        v = pv + t * dv
        if not (u >= -0.5 and v >= -0.5 and u < width - 0.5 and v < height - 0.5):
            continue
        column, row = np.int64(u + 0.5), np.int64(v + 0.5)
        if rule.rule == VISIBLE:
            if is_set(bits, height, column, row):
                continue
        elif rule.rule == OUTLINE:
            out_u = np.int64(np.floor(u - step * dv + 0.5))
            out_v = np.int64(np.floor(v + step * du + 0.5))
            if 0 <= out_u < width and 0 <= out_v < height and is_set(bits, height, out_u, out_v):
                continue
        strength = edges[row * width + column] * (1.0 / 255.0)
        if rule.squared:
            counts[EDGE_SUM] += (1.0 - strength) * (1.0 - strength)
        else:
            counts[EDGE_SUM] += strength
        counts[EDGE_COUNT] += 1.0


@njit(cache=True, nogil=True)  # type: ignore[misc]
def _sample_cone(  # type: ignore[no-untyped-def]
    c, count, wanted, out, bits, edges, width, height, rule, counts
):
    """Sample the sides of one cone, and its far end's edge, where wanted (c, 2)."""
    if out.form[c] != TAPERED:
        return
    u, v = out.u, out.v
    far, near, last = c, (ARC_POINTS - 1) * LANES + c, (count // 2) * LANES + c
    end = last + (ARC_POINTS - 1) * LANES
    if wanted[c, 0]:
        sample_side(u[end], v[end], u[far], v[far], 1.0, bits, edges, width, height, rule, counts)
        sample_side(
            u[last], v[last], u[near], v[near], -1.0, bits, edges, width, height, rule, counts
        )
    if wanted[c, 1]:
        sample_side(u[far], v[far], u[near], v[near], 1.0, bits, edges, width, height, rule, counts)


@njit(cache=True, nogil=True)  # type: ignore[misc]
def _nearest_first(cones, ends, order):  # type: ignore[no-untyped-def]
    """Sort cones by their middles' depth: what is filled so far hides what comes."""
    for i in range(1, cones):
        c = order[i]
        depth = ends[2 * LANES + c] + ends[11 * LANES + c]
        j = i - 1
        while j >= 0 and ends[2 * LANES + order[j]] + ends[11 * LANES + order[j]] > depth:
            order[j + 1] = order[j]
            j -= 1
        order[j + 1] = c


@njit(cache=True, nogil=True)  # type: ignore[misc]
def compare_view(  # type: ignore[no-untyped-def]
    body_cones, edge_cones, views, view, rule, world, out, bits, used, order, counts
):
    """Compare cones whose ends lie at world (18 rows) with what one camera sees.

    Args:
        body_cones: (c,) cones that make the silhouette.
        edge_cones: (c, 2) whether the sides, and the far edge, of a cone are sampled.
        out, bits, used, order: working memory of one thread.
        counts: (v, 4), row `view` is filled: OVERLAP, PROJECTED, EDGE_SUM, EDGE_COUNT.
    """
    cones = body_cones.size
    width, height, words = views.size[view, 0], views.size[view, 1], views.words[view]
    for i in range(4):
        counts[view, i] = 0.0
    count = find_outlines(cones, views, view, world, out)
    clear_used(words, height, used)
    for c in range(cones):
        order[c] = c
    if rule.rule == VISIBLE:
        _nearest_first(cones, out.ends, order)
    sampled = False
    for i in range(cones):
        c = order[i]
        if out.form[c] == HIDDEN:
            continue
        if edge_cones[c, 0] or edge_cones[c, 1]:
            sampled = True
            if rule.rule != OUTLINE:
                edges = views.edges[views.edge_start[view] :]
                _sample_cone(
                    c, count, edge_cones, out, bits, edges, width, height, rule, counts[view]
                )
        if body_cones[c]:
            fill_outline(c, count, out, width, height, bits, used)
    if sampled and rule.rule == OUTLINE:
        edges = views.edges[views.edge_start[view] :]
        for c in range(cones):
            if out.form[c] != HIDDEN and (edge_cones[c, 0] or edge_cones[c, 1]):
                _sample_cone(
                    c, count, edge_cones, out, bits, edges, width, height, rule, counts[view]
                )
    overlap, projected = count_and_wipe(
        words, height, bits, views.mask, views.mask_start[view], used
    )
    counts[view, OVERLAP] = overlap
    counts[view, PROJECTED] = projected


@njit(cache=True, nogil=True)  # type: ignore[misc]
def _work(  # type: ignore[no-untyped-def]
    poses, body, views, body_cones, edge_cones, rule, scratch, outlines, counts, thread, threads
):
    """Evaluate every `threads`-th pose, from pose `thread` on."""
    out = outlines_of(outlines, thread)
    bits, used, order = scratch.bits[thread], scratch.used[thread], scratch.order[thread]
    nodes, world = scratch.nodes[thread], scratch.world[thread]
    for n in range(thread, poses.shape[0], threads):
        finite = True
        for i in range(poses.shape[1]):
            finite = finite and np.isfinite(poses[n, i])
        if not finite:
            counts[n, :, :] = np.nan
            continue
        cone_ends(poses[n], body, nodes, world)
        for view in range(views.size.shape[0]):
            compare_view(
                body_cones, edge_cones, views, view, rule, world, out, bits, used, order,
                counts[n],
            )  # fmt: skip


@njit(cache=True, nogil=True)  # type: ignore[misc]
def count_serial(poses, body, views, body_cones, edge_cones, rule, scratch, outlines, counts):  # type: ignore[no-untyped-def]
    """Fill counts (n, v, 4) for poses (n, p) on the calling thread; NaN for non-finite poses."""
    _work(poses, body, views, body_cones, edge_cones, rule, scratch, outlines, counts, 0, 1)


@njit(cache=True, nogil=True, parallel=True)  # type: ignore[misc]
def count_parallel(poses, body, views, body_cones, edge_cones, rule, scratch, outlines, counts):  # type: ignore[no-untyped-def]
    """As `count_serial`, on as many threads as the scratch memory is for."""
    threads = scratch.bits.shape[0]
    for thread in prange(threads):
        _work(
            poses,
            body,
            views,
            body_cones,
            edge_cones,
            rule,
            scratch,
            outlines,
            counts,
            thread,
            threads,
        )
