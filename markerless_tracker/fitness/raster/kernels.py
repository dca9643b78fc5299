"""The compiled loops of the fitness: poses in, counts and costs out.

One particle is one piece of work: kinematics once, then view by view until the particle is known to
lose. Cones are filled as spans of bits into a frame-sized buffer of the working thread, which is
counted against the observed silhouette and wiped on the way out, so nothing is allocated per
particle. A result depends on its particle alone, hence not on the number of threads.
"""

from typing import NamedTuple

import numpy as np
from numba import prange
from numpy.typing import NDArray

from markerless_tracker.body.kinematics import node_transform
from markerless_tracker.compiled import compiled, kernel
from markerless_tracker.fitness.raster.edge_samples import (
    OUTLINE,
    VISIBLE,
    recount_still,
    sample_cone,
)
from markerless_tracker.fitness.raster.fill import (
    clear_used,
    count_and_wipe,
    count_beside_and_wipe,
    fill_outline,
)
from markerless_tracker.fitness.raster.outline import find_outlines
from markerless_tracker.fitness.raster.outline_arrays import HIDDEN, LANES, outlines_of
from markerless_tracker.fitness.terms import EDGE_COUNT, EDGE_SUM, OVERLAP, PROJECTED, view_cost
from markerless_tracker.geometry import FloatArray

_ROUNDING = 1e-9
"""More than sums of a few costs may be off by."""


class Scratch(NamedTuple):
    """Working memory of t threads, for p parameters, m nodes, c cones and h rows of w words."""

    pose: FloatArray  # (t, p)
    bits: NDArray[np.uint64]  # (t, w * h), all zero between calls
    used: NDArray[np.int64]  # (t, w, 2)
    nodes: FloatArray  # (t, m, 3, 4)
    world: FloatArray  # (t, 18 * LANES), rows as of Outlines.ends
    order: NDArray[np.int64]  # (t, c)


def make_scratch(
    threads: int, parameters: int, nodes: int, cones: int, height: int, words: int
) -> Scratch:
    """Allocate working memory for a number of threads."""
    return Scratch(
        np.empty((threads, parameters)),
        np.zeros((threads, words * height), dtype=np.uint64),
        np.empty((threads, words, 2), dtype=np.int64),
        np.empty((threads, nodes, 3, 4)),
        np.ones((threads, 18 * LANES)),
        np.empty((threads, cones), dtype=np.int64),
    )


class StaticLayer(NamedTuple):
    """What all poses of a search share, drawn once: the parts that do not move.

    Attributes:
        moving: nodes that are worked out for every pose, parents first.
        nodes: (m, 3, 4) transforms of all nodes at the search's centre.
        bits: the still parts' silhouette, as `ViewArrays.mask`; empty if everything moves.
        counts: (v, 4) the still parts' own, without edge samples that something may hide.
        sample_start: (v + 1,) view i's edge samples that something may hide begin at
            sample_start[i].
        samples: (s, 2) word * 64 + bit that hides each, and what it adds.
        least: (v + 1,) what the views from i on cost together at least.
    """

    moving: NDArray[np.int64]
    nodes: FloatArray
    bits: NDArray[np.uint64]
    counts: FloatArray
    sample_start: NDArray[np.int64]
    samples: NDArray[np.int64]
    least: FloatArray


@kernel
def cone_ends(pose, body, nodes, world):  # type: ignore[no-untyped-def]
    """Fill world (18 rows): per cone and end its centre and its two radius vectors, m."""
    for n in range(body.parent.size):
        node_transform(
            n, pose, body.parent, body.fixed, body.kind, body.sign, body.parameter, nodes
        )
    place_cones(body, nodes, world)


@kernel
def place_cones(body, nodes, world):  # type: ignore[no-untyped-def]
    """As `cone_ends`, the nodes' transforms (m, 3, 4) known."""
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


@kernel
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


@kernel
def compare_view(  # type: ignore[no-untyped-def]
    body_cones, edge_cones, views, view, rule, still, world, out, bits, used, order, counts
):
    """Draw the moving cones into one view and count.

    Args:
        body_cones: (c,) cones that make the silhouette.
        edge_cones: (c, 2) whether the sides, and the far edge, of a cone are sampled.
        out, bits, used, order: working memory of one thread.
        counts: (4,), filled.
    """
    cones = body_cones.size
    width, height, words = views.size[view, 0], views.size[view, 1], views.words[view]
    start, edge_start = views.mask_start[view], views.edge_start[view]
    beside = still.bits.size > 0
    count = find_outlines(cones, views, view, world, out)
    clear_used(words, height, used)
    for c in range(cones):
        order[c] = c
    if rule.rule == VISIBLE:
        _nearest_first(cones, out.ends, order)
    edge_sum, edge_count, sampled = 0, 0, False
    for i in range(cones):
        c = order[i]
        if out.form[c] == HIDDEN:
            continue
        if edge_cones[c, 0] or edge_cones[c, 1]:
            sampled = True
            if rule.rule != OUTLINE:
                more, number, _ = sample_cone(
                    c, count, edge_cones, out, bits, still.bits, start, views.edges, edge_start,
                    width, height, rule, still.samples[:0], 0,
                )  # fmt: skip
                edge_sum, edge_count = edge_sum + more, edge_count + number
        if body_cones[c]:
            fill_outline(c, count, out, width, height, bits, used)
    if sampled and rule.rule == OUTLINE:
        for c in range(cones):
            if out.form[c] != HIDDEN and (edge_cones[c, 0] or edge_cones[c, 1]):
                more, number, _ = sample_cone(
                    c, count, edge_cones, out, bits, still.bits, start, views.edges, edge_start,
                    width, height, rule, still.samples[:0], 0,
                )  # fmt: skip
                edge_sum, edge_count = edge_sum + more, edge_count + number
    if not beside:
        overlap, projected = count_and_wipe(words, height, bits, views.mask, start, used)
        counts[OVERLAP], counts[PROJECTED] = overlap, projected
        counts[EDGE_SUM], counts[EDGE_COUNT] = edge_sum, edge_count
        return
    more, number = recount_still(view, still, bits)
    overlap, projected = count_beside_and_wipe(
        words, height, bits, views.mask, still.bits, start, used
    )
    counts[OVERLAP] = still.counts[view, OVERLAP] + overlap
    counts[PROJECTED] = still.counts[view, PROJECTED] + projected
    counts[EDGE_SUM] = still.counts[view, EDGE_SUM] + edge_sum + more
    counts[EDGE_COUNT] = still.counts[view, EDGE_COUNT] + edge_count + number


@kernel
def evaluate(  # type: ignore[no-untyped-def]
    points, active, centre, cutoff_costs, body, views, body_cones, edge_cones, rule, cost, still,
    scratch, outlines, counts, costs, thread, threads,
):  # fmt: skip
    """Fill costs (n,) and counts (n, v, 4) of points (n, d), every `threads`-th
    point, from point `thread` on, on the calling thread.

    Args:
        points: values of the active parameters.
        active: (d,) their indices; the others are at centre (p,).
        cutoff_costs: (n,) cutoff per particle: an evaluation may stop once its cost exceeds it.
            The cost is then a lower bound of at least the cutoff, and the counts of the views not
            reached are not filled.
        body: the moving cones, and all nodes.
        body_cones, edge_cones: see `compare_view`.
        rule, cost: see `EdgeRule` and `CostRule`.

    NaN for points that are not finite.
    """
    out = outlines_of(outlines, thread)
    pose = scratch.pose[thread]
    bits, used, order = scratch.bits[thread], scratch.used[thread], scratch.order[thread]
    nodes, world = scratch.nodes[thread], scratch.world[thread]
    seen = views.size.shape[0]
    for i in range(centre.size):
        pose[i] = centre[i]
    for m in range(nodes.shape[0]):
        for i in range(3):
            for j in range(4):
                nodes[m, i, j] = still.nodes[m, i, j]
    for n in range(thread, points.shape[0], threads):
        finite = True
        for i in range(active.size):
            finite = finite and np.isfinite(points[n, i])
            pose[active[i]] = points[n, i]
        if not finite:
            for view in range(seen):
                for i in range(4):
                    counts[n, view, i] = np.nan
            costs[n] = np.nan
            continue
        for i in range(still.moving.size):
            node_transform(
                still.moving[i], pose, body.parent, body.fixed, body.kind, body.sign,
                body.parameter, nodes,
            )  # fmt: skip
        place_cones(body, nodes, world)
        total = 0.0
        for view in range(seen):
            low = (total + still.least[view]) / seen - _ROUNDING
            if low >= cutoff_costs[n]:
                break
            compare_view(
                body_cones, edge_cones, views, view, rule, still, world, out, bits, used, order,
                counts[n, view],
            )  # fmt: skip
            total += view_cost(counts[n, view], views.observed[view], cost)
            low = total / seen
        costs[n] = low


@compiled(parallel=True)
def evaluate_parallel(  # type: ignore[no-untyped-def]
    points, active, centre, cutoff_costs, body, views, body_cones, edge_cones, rule, cost, still,
    scratch, outlines, counts, costs,
):  # fmt: skip
    """As `evaluate`, on as many threads as the scratch memory is for."""
    threads = scratch.bits.shape[0]
    for thread in prange(threads):
        evaluate(
            points, active, centre, cutoff_costs, body, views, body_cones, edge_cones, rule, cost,
            still, scratch, outlines, counts, costs, thread, threads,
        )  # fmt: skip
