"""The contour of one silhouette against discs and rectangles."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from markerless_tracker.fitness.contour.silhouette_contour import (
    SilhouetteContour,
    join_edges,
    silhouette_contour,
)
from markerless_tracker.records import Observation

SIZE = (240, 200)


def observed(mask, **region) -> Observation:
    return Observation.from_mask("cam", 0, mask, np.zeros(mask.shape, np.uint8), **region)


def grid(size=SIZE):
    v, u = np.mgrid[: size[1], : size[0]]
    return u, v


def disc(at, radius, size=SIZE):
    u, v = grid(size)
    return np.hypot(u - at[0], v - at[1]) <= radius


def window(edge: SilhouetteContour):
    """Columns and rows (h, w) in the frame of an edge's distances."""
    height, width = edge.distance.shape
    v, u = np.mgrid[:height, :width]
    return u + edge.left, v + edge.top


@settings(max_examples=25, deadline=None)
@given(
    st.floats(60.0, 160.0), st.floats(60.0, 140.0), st.floats(8.0, 55.0), st.floats(1.0, 8.0)
)  # fmt: skip
def test_disc(u, v, radius, spacing_px) -> None:
    """A disc of pixels is off by up to half a pixel; the distance itself by up to 2 %."""
    edge = silhouette_contour(observed(disc((u, v), radius)), spacing_px)
    at = window(edge)
    error = edge.distance - (np.hypot(at[0] - u, at[1] - v) - radius)
    far = np.abs(edge.distance)
    assert (np.abs(error) <= 0.6 + 0.02 * far).all()
    assert abs(error[far < 3.0].mean()) < 0.2

    out = edge.points - (u, v)
    from_middle = np.linalg.norm(out, axis=1)
    assert np.abs(from_middle - radius).max() < 0.8
    outward = (out / from_middle[:, None] * edge.normals).sum(axis=1)
    assert outward.min() > 0.9
    np.testing.assert_allclose(np.linalg.norm(edge.normals, axis=1), 1.0)
    # Chains of pixels are up to 8 % longer than the curve they follow.
    assert edge.spacing.sum() == pytest.approx(2 * np.pi * radius, rel=0.09)
    gaps = np.linalg.norm(np.diff(edge.points, axis=0), axis=1)
    assert gaps.max() < 2.0 * max(spacing_px, 1.5)


@settings(max_examples=25, deadline=None)
@given(st.integers(1, 60), st.integers(1, 60), st.integers(20, 120), st.integers(20, 100))
def test_rectangle(left, top, wide, high) -> None:
    mask = np.zeros(SIZE[::-1], bool)
    mask[top : top + high, left : left + wide] = True
    edge = silhouette_contour(observed(mask), 4.0)
    u, v = window(edge)
    # The edge runs midway between the last pixel inside and the first outside.
    du = np.maximum(left - 0.5 - u, u - (left + wide - 0.5))
    dv = np.maximum(top - 0.5 - v, v - (top + high - 0.5))
    beside = np.minimum(du, dv) < 0
    error = edge.distance - np.maximum(du, dv)
    assert np.abs(error[beside]).max() < 1e-3
    corner = edge.distance[~beside] - np.hypot(du, dv)[~beside]
    assert np.abs(corner).max() <= 0.6 + 0.02 * edge.distance.max()

    on_side = np.abs(edge.normals).max(axis=1) > 0.999
    assert on_side.mean() > 0.5
    along = np.argmax(np.abs(edge.normals), axis=1)
    for axis, low, length in ((0, left, wide), (1, top, high)):
        at = edge.points[on_side & (along == axis)]
        towards = edge.normals[on_side & (along == axis), axis]
        expected = np.where(towards > 0, low + length - 0.5, low - 0.5)
        np.testing.assert_allclose(at[:, axis], expected, atol=1e-3)


def test_window_is_the_bounding_box_with_a_margin() -> None:
    mask = np.zeros((400, 300), bool)
    mask[40:340, 100:160] = True
    edge = silhouette_contour(observed(mask), 4.0, 48.3)
    # Cut at the frame.
    assert (edge.left, edge.top) == (100 - 49, 0)
    assert edge.distance.shape == (340 + 49, 60 + 2 * 49)
    small = silhouette_contour(observed(disc((120, 100), 10.0)), 4.0, 3.0)
    assert (small.left, small.top) == (110 - 24, 90 - 24)


def test_holes_have_edges_too() -> None:
    ring = disc((120, 100), 60.0) & ~disc((120, 100), 30.0)
    edge = silhouette_contour(observed(ring), 3.0)
    out = edge.points - (120, 100)
    radius = np.linalg.norm(out, axis=1)
    inner = radius < 45
    assert np.abs(radius[inner] - 30).max() < 0.8 and np.abs(radius[~inner] - 60).max() < 0.8
    outward = (out / radius[:, None] * edge.normals).sum(axis=1)
    assert outward[inner].max() < -0.9 and outward[~inner].min() > 0.9
    assert edge.spacing[inner].sum() == pytest.approx(2 * np.pi * 30, rel=0.1)


@pytest.mark.parametrize("at", [(0.0, 100.0), (239.0, 100.0), (120.0, 0.0), (120.0, 199.0)])
def test_no_points_where_the_silhouette_leaves_the_frame(at) -> None:
    edge = silhouette_contour(observed(disc(at, 50.0)), 2.0)
    assert np.abs(np.linalg.norm(edge.points - at, axis=1) - 50.0).max() < 0.8
    assert (edge.points > 0).all() and (edge.points < np.array(SIZE) - 1).all()
    # Half of it is left.
    assert edge.spacing.sum() == pytest.approx(np.pi * 50.0, rel=0.12)


def test_specks_have_no_points() -> None:
    mask = disc((120, 100), 40.0)
    speckled = mask.copy()
    speckled[30:33, 30:33] = True
    speckled[99:101, 119:121] = False
    plain, edge = (silhouette_contour(observed(m), 3.0) for m in (mask, speckled))
    np.testing.assert_array_equal(edge.points, plain.points)
    assert edge.distance.shape != plain.distance.shape


@pytest.mark.parametrize("mask", [np.zeros((50, 60), bool), disc((3, 3), 1.0)])
def test_an_empty_silhouette(mask) -> None:
    edge = silhouette_contour(observed(mask), 3.0)
    assert edge.points.shape == edge.normals.shape == (0, 2) and edge.spacing.shape == (0,)
    assert edge.distance.shape == (0, 0) or np.isfinite(edge.distance).all()


def test_a_full_frame_is_all_inside() -> None:
    edge = silhouette_contour(observed(np.ones((50, 60), bool)), 3.0)
    assert edge.points.shape == (0, 2)
    assert (edge.distance < 0).all()


@pytest.mark.parametrize("margin", [0, 1, 7, 40])
def test_a_region_says_the_same_as_the_full_frame(margin) -> None:
    mask = disc((120.3, 100.2), 45.0) | disc((150, 70), 30.0)
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    v, u = int(rows[0]) - margin, int(columns[0]) - margin
    cut = mask[v : rows[-1] + margin + 1, u : columns[-1] + margin + 1]
    part = silhouette_contour(observed(cut, size_px=SIZE, offset_px=(u, v)), 4.0)
    whole = silhouette_contour(observed(mask), 4.0)
    assert (part.left, part.top) == (whole.left, whole.top)
    for name in ("distance", "points", "normals", "spacing"):
        np.testing.assert_array_equal(getattr(part, name), getattr(whole, name))


def test_joined_edges_hold_each_views_edge() -> None:
    masks = [disc((120, 100), 40.0), np.zeros(SIZE[::-1], bool), disc((70, 60), 25.0)]
    edges = [silhouette_contour(observed(mask), 3.0) for mask in masks]
    joined = join_edges(edges)
    for i, edge in enumerate(edges):
        left, top, width, height = joined.window[i]
        assert (left, top, height, width) == (edge.left, edge.top, *edge.distance.shape)
        start = joined.distance_start[i]
        flat = joined.distance[start : start + width * height]
        np.testing.assert_array_equal(flat.reshape(height, width), edge.distance)
        part = slice(joined.point_start[i], joined.point_start[i + 1])
        np.testing.assert_array_equal(joined.points[part], edge.points)
        np.testing.assert_array_equal(joined.normals[part], edge.normals)
        np.testing.assert_array_equal(joined.spacing[part], edge.spacing)
    assert joined.point_start[-1] == len(joined.points) and len(joined.points) > 50
