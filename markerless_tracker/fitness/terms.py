"""The terms f_s and f_e of one view from counts of pixels and edge samples, and their cost."""

from typing import NamedTuple

import numpy as np

from markerless_tracker.compiled import kernel

OVERLAP, PROJECTED, EDGE_SUM, EDGE_COUNT = 0, 1, 2, 3
"""Columns of the counts: Y, Y + B, sum over the edge samples of (255 - M)² or of M (edge map,
0 .. 255), and their number. All are whole numbers: sums do not depend on the order of adding."""
EDGE_TOP = 255.0
"""Largest value of an edge map."""


class CostRule(NamedTuple):
    """Weights of the silhouette and edge terms; whether edges are squared; whether it is one-sided.

    The one-sided cost uses the observed fraction of the projected pixels instead of f_s.
    """

    silhouette_weight: float
    edge_weight: float
    squared: bool
    one_sided: bool


@kernel
def view_terms(counts, observed, squared):  # type: ignore[no-untyped-def]
    """f_s, f_e and the overlap (IoU) of one view from its counts (4,) and silhouette pixels.

    f_s = ½ Y/(B+Y) + ½ Y/(R+Y) with Y pixels projected and observed, B projected only, R observed
    only. It is 1 if the body is neither projected nor observed, 0 if it is only one of the two.
    Without edge samples f_e = 0.
    """
    both, projected, seen = counts[OVERLAP], counts[PROJECTED], np.float64(observed)
    if projected == 0.0 and seen == 0.0:
        silhouette, overlap = 1.0, 1.0
    elif projected == 0.0 or seen == 0.0:
        silhouette, overlap = 0.0, 0.0
    else:
        silhouette = 0.5 * both / projected + 0.5 * both / seen
        overlap = both / (projected + seen - both)
    if counts[EDGE_COUNT] == 0.0:
        return silhouette, 0.0, overlap
    if squared:
        edges = 1.0 - counts[EDGE_SUM] / (counts[EDGE_COUNT] * (EDGE_TOP * EDGE_TOP))
    else:
        edges = counts[EDGE_SUM] / (counts[EDGE_COUNT] * EDGE_TOP)
    return silhouette, edges, overlap


@kernel
def view_cost(counts, observed, rule):  # type: ignore[no-untyped-def]
    """Cost of one view: sum of the weights - f, never negative."""
    silhouette, edges, _ = view_terms(counts, observed, rule.squared)
    if rule.one_sided and counts[PROJECTED] > 0.0:
        silhouette = counts[OVERLAP] / counts[PROJECTED]
    return rule.silhouette_weight * (1.0 - silhouette) + rule.edge_weight * (1.0 - edges)


@kernel
def least_cost(counts, observed, rule):  # type: ignore[no-untyped-def]
    """Lower bound of the cost of a view, given the counts (4,) of the parts drawn so far.

    In the best case the other parts cover exactly the remaining observed pixels
    (docs/early-termination.md).
    """
    seen = np.float64(observed)
    missed = counts[PROJECTED] - counts[OVERLAP]
    if missed == 0.0:
        return 0.0
    share = seen / (seen + missed)
    return rule.silhouette_weight * (1.0 - (share if rule.one_sided else 0.5 * share + 0.5))
