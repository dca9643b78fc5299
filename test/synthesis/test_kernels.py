"""The renderer's compiled loops against slow twins."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from markerless_tracker.synthesis.kernels import compose, rasterize


def slow_rasterize(points, triangles, label, shade, height, width):
    """Every sample against every triangle, by barycentric coordinates."""
    nearness = np.zeros((height, width))
    labels, shades = np.zeros((height, width), int), np.zeros((height, width))
    for v in range(height):
        for u in range(width):
            for triangle in triangles:
                corners = points[triangle]
                system = np.vstack([corners[:, :2].T, np.ones(3)])
                if not np.isfinite(corners).all() or abs(np.linalg.det(system)) < 1e-12:
                    continue
                weights = np.linalg.solve(system, [u, v, 1.0])
                if (weights >= 0).all() and weights @ corners[:, 2] > nearness[v, u]:
                    nearness[v, u] = weights @ corners[:, 2]
                    labels[v, u] = label[triangle[0]]
                    shades[v, u] = weights @ shade[triangle]
    return nearness, labels, shades


def run_rasterize(points, triangles, label, shade, height, width):
    nearness, shades = np.zeros((2, height, width))
    labels = np.zeros((height, width), dtype=np.int64)
    rasterize(points, triangles, label, shade, nearness, labels, shades)
    return nearness, labels, shades


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 8))
def test_triangles_are_drawn_as_by_the_slow_twin(seed, count) -> None:
    rng = np.random.default_rng(seed)
    # No corner is shared: on a shared edge either triangle may win by rounding.
    points = np.column_stack([rng.uniform(-6, 20, (24, 2)), rng.uniform(0.2, 1.0, 24)])
    points[0, rng.integers(0, 3)] = rng.choice([np.nan, 3.3])
    triangles = np.arange(3 * count).reshape(count, 3)
    label, shade = rng.integers(0, 5, 24), rng.uniform(0, 1, 24)
    arguments = (points, triangles, label, shade, 11, 14)
    for ours, twin in zip(run_rasterize(*arguments), slow_rasterize(*arguments), strict=True):
        np.testing.assert_allclose(ours, twin, atol=1e-6)


@pytest.mark.parametrize("far", [1e9, 1e300, np.inf, -np.inf, np.nan])
def test_corners_far_outside_are_cut_off(far) -> None:
    points = np.array([[far, 0, 1.0], [0, -1e9, 1.0], [0, 1e9, 1.0], [3, 3, 1.0]])
    nearness, _, _ = run_rasterize(
        points, np.array([[0, 1, 2], [3, 3, 3]]), np.zeros(4, int), np.ones(4), 6, 6
    )
    assert set(np.unique(nearness)) <= {0.0, 1.0} or np.isfinite(nearness).all()


def test_touching_triangles_leave_no_gap() -> None:
    corners = np.array([[-1.0, -1, 1], [9, -1, 1], [9, 9, 1], [-1, 9, 1], [3.7, 4.2, 1]])
    fan = np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])
    nearness, _, _ = run_rasterize(corners, fan, np.zeros(5, int), np.ones(5), 8, 8)
    np.testing.assert_allclose(nearness, 1.0)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 4))
def test_samples_are_averaged_as_by_the_slow_twin(seed, samples) -> None:
    rng = np.random.default_rng(seed)
    height, width, darkness = 3, 5, 0.3
    background = rng.uniform(0, 255, (height, width, 3)).astype(np.float32)
    big = (height * samples, width * samples)
    body = rng.uniform(size=big) < 0.5
    cast = rng.uniform(size=big) < 0.5
    labels = rng.integers(0, 4, big).astype(np.int16)
    shades = rng.uniform(0, 1, big).astype(np.float32)
    palette = rng.uniform(0, 255, (4, 3))
    image = np.empty((height, width, 3), dtype=np.float32)
    covered = np.empty((height, width), dtype=np.float32)
    compose(
        background, body.astype(np.float32), labels, shades, palette, cast.astype(np.float32),
        darkness, samples, image, covered,
    )  # fmt: skip
    enlarged = background.repeat(samples, 0).repeat(samples, 1)
    enlarged = np.where(cast[..., None], (1 - darkness) * enlarged, enlarged)
    enlarged = np.where(body[..., None], palette[labels] * shades[..., None], enlarged)
    blocks = (height, samples, width, samples)
    np.testing.assert_allclose(image, enlarged.reshape(*blocks, 3).mean((1, 3)), rtol=1e-4)
    np.testing.assert_allclose(covered, body.reshape(blocks).mean((1, 3)), atol=1e-6)
