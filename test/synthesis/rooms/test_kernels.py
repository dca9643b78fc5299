"""The room renderer's compiled loops against slow twins and geometry."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from markerless_tracker.camera import project_camera
from markerless_tracker.synthesis.kernels import rasterize
from markerless_tracker.synthesis.rooms.kernels import (
    add_occlusion,
    add_visible,
    cover,
    nearest_triangles,
    vertex_normals,
)
from markerless_tracker.synthesis.rooms.lighting import Lighting
from markerless_tracker.synthesis.rooms.view import _seen, camera_model
from markerless_tracker.synthesis.scenes import sample_scene


def soup(seed, count):
    """Points (24, 3) with a NaN among them, triangles without a shared corner."""
    rng = np.random.default_rng(seed)
    points = np.column_stack([rng.uniform(-6, 20, (24, 2)), rng.uniform(0.2, 1.0, 24)])
    points[0, rng.integers(0, 3)] = rng.choice([np.nan, 3.3])
    return points, np.arange(3 * count).reshape(count, 3)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 8))
def test_occlusion_is_the_union_of_the_triangles(seed, count) -> None:
    points, triangles = soup(seed, count)
    points[:, 2] = np.where(np.isnan(points[:, 2]), 0.5, points[:, 2])
    nearness, shades = np.zeros((2, 11, 14))
    rasterize(
        points, triangles, np.zeros(24, int), np.ones(24), nearness,
        np.zeros((11, 14), int), shades,
    )  # fmt: skip
    total = np.full((11, 14), 0.5)
    add_occlusion(points[:, :2], triangles, 3, np.zeros((11, 14), np.int16), total, 0.25)
    np.testing.assert_allclose(total, 0.5 + 0.25 * (nearness > 0))


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 8))
def test_the_nearest_triangle_keeps_the_sample(seed, count) -> None:
    points, triangles = soup(seed, count)
    expected, shades = np.zeros((2, 11, 14))
    labels = np.zeros((11, 14), int)
    rasterize(points, triangles, np.arange(24) // 3, np.ones(24), expected, labels, shades)
    nearness, number = np.zeros((11, 14)), np.full((11, 14), -1)
    nearest_triangles(points, triangles, nearness, number)
    np.testing.assert_allclose(nearness, expected)
    np.testing.assert_array_equal(number >= 0, expected > 0)
    np.testing.assert_array_equal(number[number >= 0], labels[number >= 0])


def test_samples_of_triangles_are_averaged() -> None:
    samples, image = 2, np.full((3, 4, 3), 100.0, np.float32)
    # One triangle over the left samples of pixel (1, 1), with a colour that grows downwards.
    points = np.array([[0.0, -1.0], [0.0, 3.0], [-9.0, 1.0]])
    number = np.array([[0, -1], [0, -1]], np.int32)
    colours = np.array([[40.0, 0, 0], [80.0, 0, 0], [60.0, 0, 0]])
    covered = np.zeros((3, 4), np.float32)
    cover(
        image, 1, 1, points, np.array([[0, 1, 2]]), number, colours, np.array([True]), samples,
        covered,
    )  # fmt: skip
    assert covered[1, 1] == 0.5 and covered.sum() == 0.5
    assert image[1, 1, 0] == pytest.approx(50.0 + 0.25 * (50.0 + 60.0))
    assert image[1, 1, 1] == pytest.approx(50.0)
    assert (np.delete(image.reshape(12, 3), 5, axis=0) == 100.0).all()


def test_normals_of_a_tetrahedron_point_outward() -> None:
    vertices = np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
    triangles = np.array([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]])
    normals = np.empty((4, 3))
    vertex_normals(vertices, triangles, normals)
    np.testing.assert_allclose(normals, vertices / np.sqrt(3.0))


def test_a_depth_map_hides_what_is_behind() -> None:
    nearness = np.zeros((5, 5))
    nearness[2, 2] = 1 / 3.0
    points = np.array([[2.0, 2.0], [2.0, 2.0], [0.0, 0.0], [-40.0, 2.0]])
    total = np.zeros(4)
    add_visible(points, np.array([3.01, 3.2, 9.0, 9.0]), nearness, 0.03, 1.0, total)
    assert total.tolist() == [1.0, 0.0, 1.0, 1.0]


def test_pixels_see_points_that_project_onto_them() -> None:
    spec = sample_scene(3, (96, 72))
    lighting = Lighting(spec.room)
    for i, camera_spec in enumerate(spec.cameras):
        camera = camera_model(f"cam{i}", camera_spec, spec.sensor.size_px)
        texels, points, seen = _seen(camera, lighting, 1)
        assert (seen >= 0).mean() > 0.9
        for number, plane in enumerate(lighting.planes):
            mine = seen == number
            if not mine.any():
                continue
            np.testing.assert_allclose(points[mine][:, plane.axis], plane.level_m, atol=1e-9)
            v, u = np.nonzero(mine)
            np.testing.assert_allclose(
                project_camera(points[mine], camera), np.column_stack([u, v]), atol=0.05
            )
            rows = texels[mine][:, 1]
            assert rows.min() >= plane.rows.start - 0.5 and rows.max() <= plane.rows.stop - 0.5
            inside = np.abs(points[mine]).max(axis=1) < 2.9
            np.testing.assert_allclose(
                texels[mine][inside], plane.texels(points[mine][inside]), atol=0.01
            )
