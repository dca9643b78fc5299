"""The static layer: cones that do not move during a search are drawn once."""

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
from markerless_tracker.fitness.raster.kernels import Objective, Scratch, StaticLayer, cone_ends
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

# Sides of a cone that are sampled, including the far end's edge.
_SIDES = 3
# Spare rows in addition to the samples of a side across the frame.
_SPARE = 8


@dataclass(frozen=True, eq=False)
class Cones:
    """A subset of a body's cones: arrays, whether each is in the silhouette, its sampled edges."""

    arrays: BodyArrays
    silhouette: NDArray[np.bool_]
    edges: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Split:
    """The cones that a search moves, and the others; the same in every frame.

    Attributes:
        active: (d,) indices of the parameters that vary.
        moving: nodes that they move, parents first.
        drawn: the cones that are drawn for every pose.
        rest: the cones that are drawn once.
    """

    active: IntArray
    moving: IntArray
    drawn: Cones
    rest: Cones


def split_cones(
    body: BodyModel,
    arrays: BodyArrays,
    active: IntArray,
    silhouette_cones: NDArray[np.bool_],
    edge_cones: NDArray[np.bool_],
    rule: EdgeRule,
) -> Split:
    """The cones that the active parameters (d,) move, and the others.

    If visible edges are sampled, no cone is static, since visibility depends on the depth order of
    all cones.

    Args:
        body: the body.
        arrays: see `body_arrays`.
        active: the parameters that vary.
        silhouette_cones: (c,) cones that are part of the silhouette.
        edge_cones: (c,) cones whose edges are sampled.
        rule: how edges are sampled.
    """
    sampled = body.cone_edges & edge_cones[:, None]
    needed = silhouette_cones | sampled.any(axis=1)
    moves = moving_nodes(body, active)
    if rule.rule == VISIBLE and sampled.any():
        moves[:] = True
    drawn, rest = (
        Cones(_some(arrays, cones), silhouette_cones[cones], sampled[cones])
        for cones in (
            np.flatnonzero(needed & moves[body.cone_node]),
            np.flatnonzero(needed & ~moves[body.cone_node]),
        )
    )
    # Copied, since read-only arrays would make numba compile the kernels once more.
    return Split(np.array(active, dtype=np.int64), np.flatnonzero(moves), drawn, rest)


def draw_static(
    split: Split,
    views: ViewArrays,
    centre: FloatArray,
    rule: EdgeRule,
    cost: CostRule,
    scratch: Scratch,
    outlines: Outlines,
) -> Objective:
    """Draw the cones that do not move, at a centre (p,); arguments as in `Objective`."""
    centre = np.array(centre, dtype=np.float64)
    drawn, rest = split.drawn, split.rest
    size = rest.silhouette.size
    count = len(views.size)
    nodes = np.empty((drawn.arrays.parent.size, 3, 4))
    counts = np.zeros((count, 4))
    least = np.zeros(count + 1)
    start = np.zeros(count + 1, dtype=np.int64)
    bits = np.zeros(views.mask.size if size else 0, dtype=np.uint64)
    listed = np.empty((0, 2), dtype=np.int64)
    sides = int(rest.edges.sum()) * _SIDES if rule.rule == OUTLINE else 0
    if sides:
        # Listed samples lie inside the frame, which bounds their number per side.
        longest = ceil(int(views.size.sum(axis=1).max()) / rule.spacing_px) + _SPARE
        listed = np.empty((count * sides * longest, 2), dtype=np.int64)
    _draw_static(
        centre, rest.arrays, views, rest.silhouette, rest.edges, rule, cost, scratch.used[0], nodes,
        scratch.world[0], outlines, bits, counts, start, listed, least,
    )  # fmt: skip
    static = StaticLayer(split.moving, nodes, bits, counts, start, listed[: start[-1]], least)
    return Objective(
        split.active, centre, drawn.arrays, views, drawn.silhouette, drawn.edges, rule, cost,
        static, scratch, outlines,
    )  # fmt: skip


def _some(arrays: BodyArrays, cones: NDArray[np.int64]) -> BodyArrays:
    """The arrays of a body with a subset of its cones."""
    return arrays._replace(
        cone_node=arrays.cone_node[cones],
        cone_fixed=arrays.cone_fixed[cones],
        cone_length=arrays.cone_length[cones],
        cone_shape=arrays.cone_shape[cones],
    )


@kernel
def _draw_static(  # type: ignore[no-untyped-def]
    centre, body, views, silhouette_cones, edge_cones, rule, cost, used, nodes, world, outlines,
    bits, counts, start, listed, least,
):  # fmt: skip
    """Fill the fields of `StaticLayer` from the cones of `body`, if it has any."""
    cone_ends(centre, body, nodes, world)
    if silhouette_cones.size == 0:
        return
    out = outlines_of(outlines, 0)
    nothing = bits[:0]
    # Literals would make numba compile the functions once more.
    kept, first = np.int64(0), np.int64(0)
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
                    c, count, edge_cones, out, own, nothing, first, views.edges,
                    views.edge_start[view], width, height, rule, listed, kept,
                )  # fmt: skip
                counts[view, EDGE_SUM] += more
                counts[view, EDGE_COUNT] += number
        start[view + 1] = kept
        for i in range(own.size):
            counts[view, OVERLAP] += popcount(own[i] & views.mask[at + i])
            counts[view, PROJECTED] += popcount(own[i] & views.known[at + i])
    for view in range(views.size.shape[0] - 1, -1, -1):
        least[view] = least[view + 1] + least_cost(counts[view], views.observed[view], cost)
