"""Contours beside undecided pixels: their border is no edge."""

import cv2
import numpy as np
import pytest

from markerless_tracker.fitness.contour.silhouette_contour import (
    _NEAR_UNDECIDED,
    _without_undecided,
    signed_distance,
    silhouette_contour,
)
from markerless_tracker.records import Observation

SPACING_PX = 2.0
FAR_PX = 1000.0


def blob():
    mask = np.zeros((150, 200), np.uint8)
    cv2.ellipse(mask, (100, 75), (35, 55), 0, 0, 360, 1, -1)
    return mask > 0


def observe(person, undecided=None) -> Observation:
    edges = np.zeros(person.shape, np.uint8)
    return Observation.from_mask("cam01", 0, person, edges, undecided=undecided)


@pytest.fixture
def lower():
    """The lower part of the blob, and a shadow beside it."""
    mask = np.zeros((150, 200), bool)
    mask[100:140, 40:200] = True
    return mask


def in_window(edge, mask):
    height, width = edge.distance.shape
    return mask[edge.top : edge.top + height, edge.left : edge.left + width]


def test_no_point_lies_beside_undecided_pixels(lower) -> None:
    person = blob()
    edge = silhouette_contour(observe(person & ~lower, lower), SPACING_PX)
    away = cv2.distanceTransform((~lower).astype(np.uint8), cv2.DIST_L2, 5)
    u, v = np.rint(edge.points).astype(int).T
    assert len(edge.points) > 40 and away[v, u].min() > 1.0
    # The border of person and background has its points as before.
    plain = silhouette_contour(observe(person), SPACING_PX)
    rows = plain.points[:, 1]
    assert np.isclose(edge.spacing.sum(), plain.spacing[rows < 98].sum(), rtol=0.06)


def test_distances_are_very_large_where_that_border_is_the_nearest(lower) -> None:
    person = blob()
    edge = silhouette_contour(observe(person & ~lower, lower), SPACING_PX)
    plain = silhouette_contour(observe(person), SPACING_PX)
    assert (edge.distance[in_window(edge, lower)] > FAR_PX).all()
    # In the middle, just above the border.
    assert edge.distance[94 - edge.top, 100 - edge.left] > FAR_PX
    # Near the upper edge nothing changes.
    for v, u in ((30, 100), (60, 70), (18, 100), (60, 50)):
        one = edge.distance[v - edge.top, u - edge.left]
        assert one == pytest.approx(plain.distance[v - plain.top, u - plain.left], abs=1e-4)


def test_undecided_pixels_far_away_change_nothing() -> None:
    person = blob()
    far = np.zeros(person.shape, bool)
    far[:3, :3] = True
    edge, plain = (silhouette_contour(observe(person, u), SPACING_PX) for u in (far, None))
    np.testing.assert_array_equal(edge.points, plain.points)
    np.testing.assert_array_equal(edge.normals, plain.normals)
    near = np.abs(plain.distance) < 20.0
    np.testing.assert_array_equal(edge.distance[near], plain.distance[near])


def test_without_undecided_pixels_it_is_the_plain_contour() -> None:
    person = blob()
    edge, plain = (
        silhouette_contour(observe(person, u), SPACING_PX) for u in (np.zeros_like(person), None)
    )
    for name in ("distance", "points", "normals", "spacing"):
        np.testing.assert_array_equal(getattr(edge, name), getattr(plain, name))
    assert np.abs(plain.distance).max() < FAR_PX


def test_a_region_with_undecided_pixels(lower) -> None:
    person = blob()
    region = np.s_[10:145, 30:190]
    cut = Observation.from_mask(
        "cam01", 0, np.ascontiguousarray((person & ~lower)[region]), np.zeros((135, 160), np.uint8),
        undecided=np.ascontiguousarray(lower[region]), size_px=(200, 150), offset_px=(30, 10),
    )  # fmt: skip
    inside = np.zeros_like(person)
    inside[region] = True
    whole = silhouette_contour(observe(person & ~lower, lower & inside), SPACING_PX)
    part = silhouette_contour(cut, SPACING_PX)
    np.testing.assert_array_equal(part.points, whole.points)
    np.testing.assert_array_equal(part.distance, whole.distance)


def test_a_region_gives_the_same_as_the_frame(lower) -> None:
    """Also where the window reaches beyond the region."""
    person, region = blob() & ~lower, np.s_[15:145, 60:190]
    assert person[region].sum() == person.sum() and not person[15:17].all()
    lower[:, :60] = lower[:, 190:] = lower[145:] = False
    whole = silhouette_contour(observe(person, lower), SPACING_PX)
    cut = Observation.from_mask(
        "cam01", 0, person[region], np.zeros((130, 130), np.uint8), undecided=lower[region],
        size_px=(200, 150), offset_px=(60, 15),
    )  # fmt: skip
    part = silhouette_contour(cut, SPACING_PX)
    assert (part.left, part.top) == (whole.left, whole.top)
    for name in ("distance", "points", "normals", "spacing"):
        np.testing.assert_array_equal(getattr(part, name), getattr(whole, name))


def test_a_few_undecided_pixels_leave_distances_far_from_them(lower) -> None:
    """Rows far above are as without them."""
    person = blob()
    few = np.zeros_like(person)
    few[128:130, 95:105] = True
    edge = silhouette_contour(observe(person & ~few, few), SPACING_PX)
    plain = silhouette_contour(observe(person & ~few), SPACING_PX)
    changed = np.flatnonzero((edge.distance != plain.distance).any(axis=1))
    assert changed.size and changed[0] + edge.top > 90


@pytest.mark.parametrize("seed", range(6))
def test_near_the_edge_distances_are_those_of_the_whole_window(seed) -> None:
    rng = np.random.default_rng(seed)
    person, undecided = np.zeros((2, 120, 90), np.uint8)
    person[20:100, 30:60] = 1
    for _ in range(4):
        top, left = rng.integers(0, (110, 80))
        undecided[top : top + 10, left : left + 8] = 1
    undecided[person == 1] = 0
    radius_px = 24
    distance = signed_distance(person)
    wider = signed_distance(person | undecided)
    same = (np.abs(wider - distance) < 0.5) & (cv2.dilate(undecided, _NEAR_UNDECIDED) == 0)
    known, free = _without_undecided(distance, person, undecided, radius_px)
    near = np.abs(distance) <= radius_px
    np.testing.assert_array_equal(known[near], np.where(same, distance, 1e4)[near])
    np.testing.assert_array_equal(free, cv2.dilate(undecided, _NEAR_UNDECIDED) == 0)
