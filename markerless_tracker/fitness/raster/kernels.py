"""The compiled loops of the fitness: counts and costs of poses.

Each particle is evaluated by itself: kinematics once, then view by view until its cost exceeds the
cutoff (docs/early-termination.md). Cones are filled as bits into a frame-sized buffer of the
thread, counted against the observed silhouette and cleared, so nothing is allocated per particle.
A result depends on its particle alone, hence not on the number of threads.
"""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.body.kinematics import node_transform
from markerless_tracker.compiled import kernel
from markerless_tracker.fitness.raster.edge_samples import (
    OUTLINE,
    VISIBLE,
    EdgeRule,
    recount_static,
    sample_cone,
)
from markerless_tracker.fitness.raster.fill import (
    clear_used,
    count_and_wipe,
    count_beside_and_wipe,
    fill_outline,
)
from markerless_tracker.fitness.raster.outline import find_outlines
from markerless_tracker.fitness.raster.outline_arrays import HIDDEN, LANES, Outlines, outlines_of
from markerless_tracker.fitness.terms import (
    EDGE_COUNT,
    EDGE_SUM,
    OVERLAP,
    PROJECTED,
    CostRule,
    view_cost,
)
from markerless_tracker.geometry import FloatArray

if TYPE_CHECKING:
    from markerless_tracker.fitness.arrays import BodyArrays, ViewArrays

_ROUNDING = 1e-9
"""Upper bound of the rounding errors of a sum of a few costs."""


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
    """The parts of the body that do not move during a search, drawn once.

    Attributes:
        moving: nodes that are computed for every pose, parents first.
        nodes: (m, 3, 4) transforms of all nodes at the search's centre.
        bits: the static parts' silhouette, in the layout of `ViewArrays.mask`; empty if all move.
        counts: (v, 4) counts of the static parts, without edge samples that may be hidden.
        sample_start: (v + 1,) edge samples of view i that may be hidden begin at sample_start[i].
        samples: (s, 2) word * 64 + bit that hides each sample, and its contribution.
        least: (v + 1,) least sum of the costs of the views from i on.
    """

    moving: NDArray[np.int64]
    nodes: FloatArray
    bits: NDArray[np.uint64]
    counts: FloatArray
    sample_start: NDArray[np.int64]
    samples: NDArray[np.int64]
    least: FloatArray


class Objective(NamedTuple):
    """The comparison of one search, in the layout of the kernels.

    Attributes:
        active: (d,) indices of the parameters that vary.
        centre: (p,) values of the others.
        body: all nodes, and the cones that are drawn for every pose.
        views: the evidence.
        silhouette_cones: (c,) whether each cone of `body` is part of the silhouette.
        edge_cones: (c, 2) whether its sides, and the edge of its far end, are sampled.
        rule, cost: how edges are sampled, and the weights of the terms.
        static: the cones that are drawn once.
        scratch, outlines: working memory.
    """

    active: NDArray[np.int64]
    centre: FloatArray
    body: "BodyArrays"
    views: "ViewArrays"
    silhouette_cones: NDArray[np.bool_]
    edge_cones: NDArray[np.bool_]
    rule: EdgeRule
    cost: CostRule
    static: StaticLayer
    scratch: Scratch
    outlines: Outlines


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
    """As `cone_ends`, given the transforms of the nodes (m, 3, 4)."""
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
    """Sort cones by depth of their middles, so that filled cones hide later ones."""
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
    body_cones, edge_cones, views, view, rule, static, world, out, bits, used, order, counts
):
    """Draw the moving cones into one view and count.

    Args:
        body_cones: (c,) cones that are part of the silhouette.
        edge_cones: (c, 2) whether a cone's sides, and the edge of its far end, are sampled.
        out, bits, used, order: working memory of one thread.
        counts: (4,), filled.
    """
    cones = body_cones.size
    width, height, words = views.size[view, 0], views.size[view, 1], views.words[view]
    start, edge_start = views.mask_start[view], views.edge_start[view]
    beside = static.bits.size > 0
    count = find_outlines(cones, views, view, world, out)
    clear_used(words, height, used)
    for c in range(cones):
        order[c] = c
    if rule.rule == VISIBLE:
        _nearest_first(cones, out.ends, order)
    edge_sum, edge_count, sampled = 0, 0, False
    none = np.int64(0)
    for i in range(cones):
        c = order[i]
        if out.form[c] == HIDDEN:
            continue
        if edge_cones[c, 0] or edge_cones[c, 1]:
            sampled = True
            if rule.rule != OUTLINE:
                more, number, _ = sample_cone(
                    c, count, edge_cones, out, bits, static.bits, start, views.edges, edge_start,
                    width, height, rule, static.samples[:0], none,
                )  # fmt: skip
                edge_sum, edge_count = edge_sum + more, edge_count + number
        if body_cones[c]:
            fill_outline(c, count, out, width, height, bits, used)
    if sampled and rule.rule == OUTLINE:
        for c in range(cones):
            if out.form[c] != HIDDEN and (edge_cones[c, 0] or edge_cones[c, 1]):
                more, number, _ = sample_cone(
                    c, count, edge_cones, out, bits, static.bits, start, views.edges, edge_start,
                    width, height, rule, static.samples[:0], none,
                )  # fmt: skip
                edge_sum, edge_count = edge_sum + more, edge_count + number
    if not beside:
        overlap, projected = count_and_wipe(
            words, height, bits, views.mask, views.known, start, used
        )
        counts[OVERLAP], counts[PROJECTED] = overlap, projected
        counts[EDGE_SUM], counts[EDGE_COUNT] = edge_sum, edge_count
        return
    more, number = recount_static(view, static, bits)
    overlap, projected = count_beside_and_wipe(
        words, height, bits, views.mask, views.known, static.bits, start, used
    )
    counts[OVERLAP] = static.counts[view, OVERLAP] + overlap
    counts[PROJECTED] = static.counts[view, PROJECTED] + projected
    counts[EDGE_SUM] = static.counts[view, EDGE_SUM] + edge_sum + more
    counts[EDGE_COUNT] = static.counts[view, EDGE_COUNT] + edge_count + number


@kernel
def evaluate(points, cutoff_costs, objective, counts, costs, thread, threads):  # type: ignore[no-untyped-def]
    """Fill costs (n,) and counts (n, v, 4) of points (n, d) on the calling thread.

    Only every `threads`-th point is evaluated, from point `thread` on.

    Args:
        points: values of the active parameters.
        cutoff_costs: (n,) cutoff per particle: an evaluation may stop once its cost exceeds it.
            The cost is then a lower bound of at least the cutoff, and the counts of the remaining
            views are not filled.
        objective: see `Objective`.

    NaN for points that are not finite.
    """
    o = objective
    active, centre, body, views = o.active, o.centre, o.body, o.views
    static, scratch = o.static, o.scratch
    out = outlines_of(o.outlines, thread)
    pose = scratch.pose[thread]
    bits, used, order = scratch.bits[thread], scratch.used[thread], scratch.order[thread]
    nodes, world = scratch.nodes[thread], scratch.world[thread]
    seen = views.size.shape[0]
    for i in range(centre.size):
        pose[i] = centre[i]
    for m in range(nodes.shape[0]):
        for i in range(3):
            for j in range(4):
                nodes[m, i, j] = static.nodes[m, i, j]
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
        for i in range(static.moving.size):
            node_transform(
                static.moving[i], pose, body.parent, body.fixed, body.kind, body.sign,
                body.parameter, nodes,
            )  # fmt: skip
        place_cones(body, nodes, world)
        total = 0.0
        for view in range(seen):
            low = (total + static.least[view]) / seen - _ROUNDING
            if low >= cutoff_costs[n]:
                break
            compare_view(
                o.silhouette_cones, o.edge_cones, views, view, o.rule, static, world, out, bits,
                used, order, counts[n, view],
            )  # fmt: skip
            total += view_cost(counts[n, view], views.observed[view], o.cost)
            low = total / seen
        costs[n] = low
