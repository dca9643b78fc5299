"""Polygons as bits, against half-planes in NumPy."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from markerless_tracker.fitness.raster.fill import clear_used, fill_outline
from markerless_tracker.fitness.raster.outline import scan_edges
from markerless_tracker.fitness.raster.outline_arrays import LANES, make_outlines, outlines_of
from markerless_tracker.records import unpack_mask

LANE = 3
"""Which of the polygons that are worked on side by side the tests fill."""


def fill(points, width: int, height: int):
    """Words (w, h) and mask (h, w) that `fill_outline` sets, and the rows it says it used."""
    words = (width + 63) // 64
    bits = np.zeros(words * height, dtype=np.uint64)
    used = np.empty((words, 2), dtype=np.int64)
    clear_used(words, height, used)
    out = outlines_of(make_outlines(1, height), 0)
    for i, (u, v) in enumerate(np.asarray(points, dtype=np.float64)):
        out.u[i * LANES + LANE], out.v[i * LANES + LANE] = u, v
    # Whatever an earlier polygon left behind must not matter.
    out.left[:], out.right[:] = 7.0, 20.0
    scan_edges(LANE + 1, len(points), height, out.u, out.v, out.first, out.slope, out.box)
    fill_outline(LANE, len(points), out, width, height, bits, used)
    frame = bits.reshape(words, height)
    return frame, unpack_mask(np.ascontiguousarray(frame.T), width), used


def inside_convex(points, width: int, height: int):
    """Pixel centres strictly inside, and those within 1e-6 px of the boundary, (h, w) both."""
    u, v = np.meshgrid(np.arange(width), np.arange(height))
    following = np.roll(points, -1, axis=0)
    area = np.sum(points[:, 0] * following[:, 1] - points[:, 1] * following[:, 0])
    least = np.full((height, width), np.inf)
    for (pu, pv), (qu, qv) in zip(points, following, strict=True):
        length = np.hypot(qu - pu, qv - pv)
        side = np.sign(area) * ((qu - pu) * (v - pv) - (qv - pv) * (u - pu)) / length
        least = np.minimum(least, side)
    return least > 1e-6, np.abs(least) <= 1e-6


@settings(deadline=None)
@given(
    st.integers(0, 2**32 - 1),
    st.integers(3, 14),
    st.floats(0.3, 120.0),
    st.tuples(st.floats(-40.0, 190.0), st.floats(-40.0, 110.0)),
    st.booleans(),
)
def test_convex_polygons_fill_exactly_the_pixel_centres_inside(seed, corners, size, at, clockwise):
    width, height = 150, 70
    rng = np.random.default_rng(seed)
    angle = np.sort(rng.uniform(0.0, 2.0 * np.pi, corners))
    stretch = rng.uniform(0.2, 1.0, 2)
    points = np.stack([np.cos(angle), np.sin(angle)], axis=1) * stretch * size + at
    points = points[::-1] if clockwise else points
    if np.min(np.linalg.norm(points - np.roll(points, -1, axis=0), axis=1)) < 1e-3:
        return
    words, filled, used = fill(points, width, height)
    inside, undecided = inside_convex(points, width, height)
    np.testing.assert_array_equal(filled[~undecided], inside[~undecided])
    # Only what is said to be used is wiped afterwards.
    for column, (first, last) in zip(words, used, strict=True):
        assert not column[:first].any() and not column[last + 1 :].any()


def test_two_polygons_that_share_an_edge_leave_no_gap():
    """Between the pixels of two halves lies none that neither holds."""
    left = np.array([[10.2, 5.1], [30.7, 8.3], [25.4, 40.9], [8.8, 33.3]])
    right = np.array([[30.7, 8.3], [55.5, 3.2], [60.1, 44.4], [25.4, 40.9]])
    whole = inside_convex(left, 80, 60)[0] | inside_convex(right, 80, 60)[0]
    assert not (whole & ~(fill(left, 80, 60)[1] | fill(right, 80, 60)[1])).any()


@pytest.mark.parametrize(
    "points",
    [
        [[1e300, -1e300], [1e300, 1e300], [-1e300, 1e300]],
        [[np.nan, 3.0], [4.0, 5.0], [6.0, np.nan]],
        [[np.inf, 3.0], [-np.inf, 5.0], [6.0, 9.0]],
        [[5.5, 5.5], [5.5, 5.5], [5.5, 5.5]],
    ],
    ids=["huge", "nan", "infinite", "empty"],
)
def test_polygons_that_are_none_stay_inside_the_frame(points):
    words, _, _ = fill(np.array(points), 70, 30)
    padding = unpack_mask(np.ascontiguousarray(words.T), 128)[:, 70:]
    assert not padding.any()
