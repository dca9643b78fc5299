"""First guesses of a start: postures at the hull's trunk, feet on the floor, head at its top."""

import numpy as np
import pytest

from markerless_tracker.body import load_body, markers_of_many
from markerless_tracker.body.anatomy import heading, heading_difference, posture
from markerless_tracker.body.model import MARKER_NAMES
from markerless_tracker.tracking.candidates.postures import (
    ANKLE_M,
    HEADINGS,
    POSTURES,
    VARIATIONS,
    ankle_heights_m,
    first_guesses,
    postures,
)
from markerless_tracker.tracking.config import TrackerConfig
from markerless_tracker.tracking.evidence.grid import FINE_M
from markerless_tracker.tracking.evidence.hull import Hull
from markerless_tracker.tracking.limits import joint_limits

ANKLES = [MARKER_NAMES.index(name) for name in ("LAnkle", "RAnkle")]


@pytest.fixture(scope="module")
def body():
    return load_body("person32")


def hull_from(low_m, trunk_m):
    points = np.array([[0.0, 0.0, low_m + 0.5 * FINE_M], [0.0, 0.0, 1.7]])
    return Hull(points, np.array([trunk_m]), points)


def guesses(body, hull):
    limits = joint_limits(body, TrackerConfig())
    return first_guesses(body, limits, hull, np.random.default_rng(0))


def test_feet_stand_on_the_floor_whatever_the_hulls_trunk_is(body) -> None:
    """A wide skirt draws it down by 0.3 m."""
    known, count = postures(body), len(POSTURES)
    low, high = (guesses(body, hull_from(0.0, [0.5, 0.2, z])) for z in (0.7, 1.0))
    assert low.shape == (HEADINGS, 3 * count + VARIATIONS, body.size)
    heights = markers_of_many(body, low[:, count : 2 * count].reshape(-1, body.size))[:, ANKLES, 2]
    np.testing.assert_allclose(heights.min(axis=1), ANKLE_M, atol=1e-9)
    np.testing.assert_allclose(low[:, count : 2 * count], high[:, count : 2 * count], atol=1e-9)
    # The others follow the trunk.
    z = body.index("pelvis_tz")
    np.testing.assert_allclose(high[:, :count, z] - low[:, :count, z], 0.3, atol=1e-9)
    assert known.shape == (count, body.size)


def test_the_head_is_at_the_hulls_top_wherever_the_trunk_is(body) -> None:
    """The lap of a seated person may be the thickest part."""
    points = np.array([[0.0, 0.0, 0.0], [0.3, 0.1, 1.20], [0.4, 0.1, 1.25], [0.7, 0.7, 1.0]])
    hull = Hull(points, np.array([[0.9, 0.9, 0.5]]), points)
    last = guesses(body, hull)[:, -len(POSTURES) :]
    assert last.shape[:2] == (HEADINGS, len(POSTURES))
    heads = markers_of_many(body, last.reshape(-1, body.size))[:, MARKER_NAMES.index("Head")]
    expected = np.tile([0.35, 0.1, 1.25 + 0.5 * FINE_M], (len(heads), 1))
    np.testing.assert_allclose(heads, expected, atol=1e-9)


def test_half_of_the_variations_stand_on_the_floor(body) -> None:
    count = len(POSTURES)
    varied = guesses(body, hull_from(0.0, [0.5, 0.2, 0.7]))[0, 2 * count :][:VARIATIONS]
    heights = markers_of_many(body, varied)[:, ANKLES, 2].min(axis=1)
    assert (np.abs(heights - ANKLE_M) < 1e-9).sum() == VARIATIONS // 2


def test_headings_are_spread_evenly(body) -> None:
    standing = guesses(body, hull_from(0.0, [0.0, 0.0, 1.0]))[:, 0]
    angles = [heading(points) for points in markers_of_many(body, standing)]
    gaps = [heading_difference(a, b) for a, b in zip(angles, angles[1:], strict=False)]
    np.testing.assert_allclose(gaps, 2.0 * np.pi / HEADINGS, atol=1e-6)


def test_a_hull_that_ends_above_the_floor_may_lack_the_feet() -> None:
    assert ankle_heights_m(hull_from(-0.04, [0.0, 0.0, 1.0])) == (ANKLE_M,)
    heights = ankle_heights_m(hull_from(0.5, [0.0, 0.0, 1.0]))
    assert heights == pytest.approx((0.5 + ANKLE_M, ANKLE_M))


@pytest.mark.parametrize("name", ["person32", "person35", "humaneva34", "balan31"])
def test_postures_are_made_once_for_all_sizes_of_a_body(name: str) -> None:
    small, tall = load_body(name, 1.5), load_body(name, 1.9)
    assert postures(small) is postures(tall)
    for body in (small, tall):
        own = np.array([posture(body, angles) for angles in POSTURES])
        np.testing.assert_array_equal(postures(body), own)


def test_other_bodies_have_postures_of_their_own() -> None:
    assert postures(load_body("person32")) is not postures(load_body("person34"))
