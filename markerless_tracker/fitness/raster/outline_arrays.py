"""Working memory of outlines: all cones of a body side by side.

A quantity is a row of `LANES` numbers, one a cone, and each loop over the cones is one that the
compiler turns into vector instructions.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.compiled import inlined
from markerless_tracker.geometry import FloatArray

LANES = 64
"""Numbers in a row, and the most cones of a body."""
ARC_POINTS = 7
"""Points of an end's arc between the two tangents, both included."""
SIDE_POINTS = 2
"""Points inside a side that is seen through a distorting lens; none otherwise."""
MAX_POINTS = 2 * (ARC_POINTS + SIDE_POINTS)
NEAR_M = 0.1
"""Cones that come nearer to a camera's plane than this are not drawn in it."""
HIDDEN, TAPERED, ONLY_END = 0, 1, 2
"""Forms of an outline: not drawn; both ends show; ONLY_END + e: end e hides all the rest."""

VECTOR_LANES = 8
"""Loops run over a multiple of this many lanes, so that none is left over."""
TINY = 1e-300


class Outlines(NamedTuple):
    """Working memory of one view's outlines: rows of `LANES` numbers, one after the other.

    Attributes:
        ends: 18 rows: row 9 e + 3 m + i holds coordinate i (m, camera frame) of end e's centre
            (m = 0) and of its two radius vectors (m = 1, 2).
        flat: 12 rows: row 6 e + 2 m + i holds their images to first order, at focal length 1.
        arcs: 8 rows: from row 4 e on cos and sin of the angle at which end e's arc begins and of
            that at which it ends. End 1's arc leads from side 0 to side 1, end 0's back. Side 0
            lies to the right of the way from end 0 to end 1 as the camera sees it (y down).
        form: one row: HIDDEN, TAPERED, or ONLY_END + e, whose arc is then a full turn.
        u, v: MAX_POINTS rows each, the polygons' points, px.
        first: MAX_POINTS rows, the first pixel row at or below each point, 0 .. height.
        slope: MAX_POINTS rows, du/dv of the edge that leads to each point.
        box: 4 rows, least and largest u (px), least and largest `first`.
        left, right: where the polygon that is being filled begins and ends in each row of the
            frame, px.
    """

    ends: FloatArray
    flat: FloatArray
    arcs: FloatArray
    form: NDArray[np.int64]
    u: FloatArray
    v: FloatArray
    first: NDArray[np.int32]
    slope: FloatArray
    box: FloatArray
    left: FloatArray
    right: FloatArray


def make_outlines(threads: int, height: int) -> Outlines:
    """Allocate working memory for some threads and frames of at most `height` rows.

    Every attribute gets a first axis, the thread.
    """

    def rows(count: int) -> FloatArray:
        # Lanes without a cone are worked on too; ones keep them harmless.
        return np.ones((threads, count * LANES))

    return Outlines(
        rows(18), rows(12), rows(8), np.zeros((threads, LANES), dtype=np.int64),
        rows(MAX_POINTS), rows(MAX_POINTS),
        np.zeros((threads, MAX_POINTS * LANES), dtype=np.int32), rows(MAX_POINTS), rows(4),
        np.zeros((threads, height)), np.zeros((threads, height)),
    )  # fmt: skip


@inlined
def outlines_of(all_threads, i):  # type: ignore[no-untyped-def]
    """Thread i's part of `make_outlines`."""
    a = all_threads
    return Outlines(
        a.ends[i], a.flat[i], a.arcs[i], a.form[i], a.u[i], a.v[i], a.first[i], a.slope[i],
        a.box[i], a.left[i], a.right[i],
    )  # fmt: skip
