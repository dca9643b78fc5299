"""Working memory of outlines: all cones of a body in parallel.

A quantity is a row of `LANES` numbers, one per cone. The compiler vectorises each loop over cones.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.compiled import inlined
from markerless_tracker.geometry import FloatArray

LANES = 64
"""Numbers in a row; the largest number of cones of a body."""
ARC_POINTS = 7
"""Points of an end's arc, including both tangent points."""
SIDE_POINTS = 2
"""Points inside a side, if the lens distorts; otherwise there are none."""
MAX_POINTS = 2 * (ARC_POINTS + SIDE_POINTS)
"""Largest number of points of a polygon."""
NEAR_M = 0.1
"""Least distance from the camera's plane; nearer cones are not drawn in that view."""
HIDDEN, TAPERED, ONLY_END = 0, 1, 2
"""Forms of an outline: not drawn; both ends visible; ONLY_END + e: end e hides the whole cone."""

VECTOR_LANES = 8
"""Loops run over a multiple of this number of lanes, without a remainder."""
BLOCK_ROWS = 8
"""Loops along the edges of a polygon run over a multiple of this number of rows."""
TINY = 1e-300


class Outlines(NamedTuple):
    """Working memory of one view's outlines: rows of `LANES` numbers, one after the other.

    Attributes:
        ends: 18 rows: row 9 e + 3 m + i holds coordinate i (m, camera frame) of end e's centre
            (m = 0) and of its two radius vectors (m = 1, 2).
        flat: 12 rows: row 6 e + 2 m + i holds their images to first order, at focal length 1.
        arcs: 8 rows: from row 4 e on cos and sin of the angles at which end e's arc begins and
            ends. End 1's arc goes from side 0 to side 1, end 0's arc back. Side 0 lies to the right
            of the direction from end 0 to end 1 in the image (v down).
        form: one row: HIDDEN, TAPERED, or ONLY_END + e; in that case the arc is a full circle.
        u, v: MAX_POINTS rows each, the polygons' points, px.
        first: MAX_POINTS rows, the first pixel row at or below each point, 0 .. height.
        slope: MAX_POINTS rows, du/dv of the edge that leads to each point.
        box: 4 rows, least and largest u (px), least and largest `first`.
        left, right: begin and end, in each row of the frame, of the polygon being filled, px; row
            0 of the frame lies at BLOCK_ROWS.
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
    """Allocate working memory for several threads and frames of at most `height` rows.

    The first axis of every attribute is the thread.
    """

    def rows(count: int) -> FloatArray:
        # Lanes without a cone are computed, too; ones keep their values finite.
        return np.ones((threads, count * LANES))

    rows_in_all = height + 2 * BLOCK_ROWS
    return Outlines(
        rows(18), rows(12), rows(8), np.zeros((threads, LANES), dtype=np.int64),
        rows(MAX_POINTS), rows(MAX_POINTS),
        np.zeros((threads, MAX_POINTS * LANES), dtype=np.int32), rows(MAX_POINTS), rows(4),
        np.zeros((threads, rows_in_all)), np.zeros((threads, rows_in_all)),
    )  # fmt: skip


@inlined
def outlines_of(all_threads, i):  # type: ignore[no-untyped-def]
    """Thread i's part of `make_outlines`."""
    a = all_threads
    return Outlines(
        a.ends[i], a.flat[i], a.arcs[i], a.form[i], a.u[i], a.v[i], a.first[i], a.slope[i],
        a.box[i], a.left[i], a.right[i],
    )  # fmt: skip
