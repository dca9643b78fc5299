"""The nearest outline point, against a search of all of them."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from markerless_tracker.fitness.contour.nearest import (
    make_bands,
    nearest_facing,
    sort_into_bands,
)
from markerless_tracker.fitness.contour.outline_samples import MAX_SAMPLES

WIDTH, HEIGHT = 90, 70


def directions(rng: np.random.Generator, count: int):
    angle = rng.uniform(0.0, 2.0 * np.pi, count)
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)


def nearest_of_all(at, facing, most_px, pixel, normal) -> int:
    gap = np.linalg.norm(pixel - at, axis=1)
    gap[(normal @ facing <= 0.5) | (gap >= most_px)] = np.inf
    return int(np.argmin(gap)) if np.isfinite(gap).any() else -1


@settings(deadline=None)
@given(
    st.integers(0, 2**32 - 1),
    st.one_of(st.integers(0, 40), st.sampled_from([MAX_SAMPLES - 1, MAX_SAMPLES])),
    st.floats(0.5, 120.0),
)
def test_the_nearest_of_the_points_that_face_the_same_way(seed, count, most_px):
    rng = np.random.default_rng(seed)
    bands = make_bands(1, HEIGHT)
    start, order, points = bands.start[0], bands.order[0], bands.points[0]
    # Remains of an earlier frame must not matter.
    points[:2], points[2:] = 30.0, 0.7
    pixel = np.empty((MAX_SAMPLES, 2))
    pixel[:] = rng.uniform((0.0, 0.0), (WIDTH - 1.0, HEIGHT - 1.0), (MAX_SAMPLES, 2))
    normal = directions(rng, MAX_SAMPLES)
    number = sort_into_bands(count, HEIGHT, pixel, normal, start, order, points)
    assert sorted(order[:count]) == list(range(count))
    # The silhouette's edge may lie half a pixel outside of the frame's pixels.
    for at in rng.uniform((-0.5, -0.5), (WIDTH - 0.5, HEIGHT - 0.5), (20, 2)):
        facing = directions(rng, 1)[0]
        found = nearest_facing(
            at[0], at[1], facing[0], facing[1], most_px**2, number, start, order, points
        )
        assert found == nearest_of_all(at, facing, most_px, pixel[:count], normal[:count])


@pytest.mark.parametrize("most_px", [0.0, np.inf])
def test_without_points_none_is_found(most_px):
    bands = make_bands(1, HEIGHT)
    start, order, points = bands.start[0], bands.order[0], bands.points[0]
    none = np.empty((0, 2))
    number = sort_into_bands(0, HEIGHT, none, none, start, order, points)
    assert nearest_facing(5.0, 5.0, 1.0, 0.0, most_px, number, start, order, points) == -1
