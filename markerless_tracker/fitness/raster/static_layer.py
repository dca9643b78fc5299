"""Drawing once what does not move during a search."""

from dataclasses import dataclass
from math import ceil

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.body import BodyModel
from markerless_tracker.body.kinematics import moving_nodes
from markerless_tracker.body.model import IntArray
from markerless_tracker.compiled import kernel
from markerless_tracker.fitness.arrays import BodyArrays, ViewArrays
from markerless_tracker.fitness.raster.bits import popcount
from markerless_tracker.fitness.raster.edge_samples import OUTLINE, VISIBLE, EdgeRule, sample_cone
from markerless_tracker.fitness.raster.fill import clear_used, fill_outline
from markerless_tracker.fitness.raster.kernels import Scratch, StaticLayer, cone_ends
from markerless_tracker.fitness.raster.outline import find_outlines
from markerless_tracker.fitness.raster.outline_arrays import HIDDEN, Outlines, outlines_of
from markerless_tracker.fitness.terms import (
    EDGE_COUNT,
    EDGE_SUM,
    OVERLAP,
    PROJECTED,
    CostRule,
    least_cost,
)
from markerless_tracker.geometry import FloatArray

_SIDES = 3
_SPARE = 8


@dataclass(frozen=True, eq=False)
class Drawing:
    """How the poses of one search are drawn.

    Attributes:
        body: all nodes, and the cones that are drawn for every pose.
        silhouette_cones: (c,) which of them make the silhouette.
        edge_cones: (c, 2) whether their sides, and their far edges, are sampled.
        still: what is drawn once.
    """

    body: BodyArrays
    silhouette_cones: NDArray[np.bool_]
    edge_cones: NDArray[np.bool_]
    still: StaticLayer


def split_static(
    body: BodyModel,
    arrays: BodyArrays,
    views: ViewArrays,
    active: IntArray,
    centre: FloatArray,
    silhouette_cones: NDArray[np.bool_],
    edge_cones: NDArray[np.bool_],
    rule: EdgeRule,
    cost: CostRule,
    scratch: Scratch,
    outlines: Outlines,
) -> Drawing:
    """Draw the cones that do not depend on the active parameters (d,), at a centre (p,).

    Which edges are visible depends on the order of all cones in depth: where such edges are
    sampled, nothing counts as still.

    Args:
        body: the body.
        arrays: see `body_arrays`.
        views: the views.
        active: the parameters that vary.
        centre: the pose of the others.
        silhouette_cones: (c,) cones that make the silhouette.
        edge_cones: (c,) cones whose edges are sampled.
        rule, cost: how edges are sampled and what terms cost.
        scratch, outlines: working memory.
    """
    sampled = body.cone_edges & edge_cones[:, None]
    needed = silhouette_cones | sampled.any(axis=1)
    moves = moving_nodes(body, active)
    if rule.rule == VISIBLE and sampled.any():
        moves[:] = True
    drawn = np.flatnonzero(needed & moves[body.cone_node])
    rest = np.flatnonzero(needed & ~moves[body.cone_node])
    count = len(views.size)
    nodes = np.empty((body.node_parent.size, 3, 4))
    cone_ends(centre, arrays, nodes, scratch.world[0])
    counts = np.zeros((count, 4))
    least = np.zeros(count + 1)
    start = np.zeros(count + 1, dtype=np.int64)
    bits = np.zeros(views.mask.size if rest.size else 0, dtype=np.uint64)
    listed = np.empty((0, 2), dtype=np.int64)
    if rest.size:
        # Samples that may be hidden lie inside the frame, so a side has no more than these.
        longest = ceil(int(views.size.sum(axis=1).max()) / rule.spacing_px) + _SPARE
        sides = int(sampled[rest].sum()) * _SIDES if rule.rule == OUTLINE else 0
        listed = np.empty((count * sides * longest, 2), dtype=np.int64)
        _draw_still(
            centre, _some(arrays, rest), views, silhouette_cones[rest], sampled[rest], rule, cost,
            scratch.used[0], nodes, scratch.world[0], outlines, bits, counts, start, listed, least,
        )  # fmt: skip
    still = StaticLayer(
        np.flatnonzero(moves), nodes, bits, counts, start, listed[: start[-1]], least,
    )  # fmt: skip
    return Drawing(_some(arrays, drawn), silhouette_cones[drawn], sampled[drawn], still)


def _some(arrays: BodyArrays, cones: NDArray[np.int64]) -> BodyArrays:
    """The arrays of a body with some of its cones."""
    return arrays._replace(
        cone_node=arrays.cone_node[cones],
        cone_fixed=arrays.cone_fixed[cones],
        cone_length=arrays.cone_length[cones],
        cone_shape=arrays.cone_shape[cones],
    )


@kernel
def _draw_still(  # type: ignore[no-untyped-def]
    centre, body, views, silhouette_cones, edge_cones, rule, cost, used, nodes, world, outlines,
    bits, counts, start, listed, least,
):  # fmt: skip
    """Fill the fields of `StaticLayer` from the cones of `body`."""
    cone_ends(centre, body, nodes, world)
    out = outlines_of(outlines, 0)
    nothing = bits[:0]
    kept = 0
    for view in range(views.size.shape[0]):
        width, height, words = views.size[view, 0], views.size[view, 1], views.words[view]
        at = views.mask_start[view]
        own = bits[at : at + words * height]
        count = find_outlines(silhouette_cones.size, views, view, world, out)
        clear_used(words, height, used)
        for c in range(silhouette_cones.size):
            if silhouette_cones[c] and out.form[c] != HIDDEN:
                fill_outline(c, count, out, width, height, own, used)
        for c in range(silhouette_cones.size):
            if out.form[c] != HIDDEN:
                more, number, kept = sample_cone(
                    c, count, edge_cones, out, own, nothing, 0, views.edges,
                    views.edge_start[view], width, height, rule, listed, kept,
                )  # fmt: skip
                counts[view, EDGE_SUM] += more
                counts[view, EDGE_COUNT] += number
        start[view + 1] = kept
        for i in range(own.size):
            counts[view, OVERLAP] += popcount(own[i] & views.mask[at + i])
            counts[view, PROJECTED] += popcount(own[i])
    for view in range(views.size.shape[0] - 1, -1, -1):
        least[view] = least[view + 1] + least_cost(counts[view], views.observed[view], cost)
