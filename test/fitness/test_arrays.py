"""Laying out views: order, regions, sizes."""

from dataclasses import replace

import numpy as np
import pytest

from markerless_tracker.camera import CameraModel, CameraRig
from markerless_tracker.errors import BodyModelError, ImageError
from markerless_tracker.fitness import lay_out_views
from markerless_tracker.fitness.arrays import body_arrays
from markerless_tracker.fitness.raster.outline_arrays import LANES
from markerless_tracker.records import Observation, pack_mask, unpack_mask


@pytest.fixture
def cameras() -> tuple[CameraModel, ...]:
    matrix = np.array([[50.0, 1.5, 20.0], [0.0, 60.0, 10.0], [0.0, 0.0, 1.0]])
    more = np.array([[1.0, 1.0, 1.0], [0.0, 1.0, 1.0], [0.0, 0.0, 0.0]])
    return tuple(
        CameraModel(name, size, matrix + i * more, np.arange(5) * 0.01 * i, np.eye(4))
        for i, (name, size) in enumerate((("a", (70, 9)), ("b", (33, 20)), ("c", (64, 5))))
    )


def observation(camera: CameraModel, seed: int) -> Observation:
    rng = np.random.default_rng(seed)
    shape = camera.size_px[::-1]
    return Observation.from_mask(
        camera.name, 0, rng.random(shape) < 0.4, rng.integers(0, 256, shape, dtype=np.uint8)
    )


def test_views_are_in_the_order_of_the_cameras(cameras):
    seen = {c.name: observation(c, i) for i, c in enumerate(cameras)}
    views = lay_out_views(cameras, {name: seen[name] for name in ("c", "a", "b")})
    assert views.names == ("a", "b", "c")
    arrays = views.arrays
    for i, camera in enumerate(cameras):
        width, height = camera.size_px
        assert tuple(arrays.size[i]) == (width, height)
        words = int(arrays.words[i])
        mask = arrays.mask[arrays.mask_start[i] :][: words * height].reshape(words, height)
        edges = arrays.edges[arrays.edge_start[i] :][: width * height].reshape(height, width)
        np.testing.assert_array_equal(
            unpack_mask(np.ascontiguousarray(mask.T), width), seen[camera.name].mask
        )
        np.testing.assert_array_equal(edges, seen[camera.name].edges)
        assert arrays.observed[i] == seen[camera.name].mask.sum()
        k = camera.matrix
        expected = [k[0, 0], k[0, 1], k[0, 2], k[1, 1], k[1, 2]]
        np.testing.assert_array_equal(arrays.intrinsics[i], expected)
        np.testing.assert_array_equal(arrays.distortion[i], camera.distortion)
    assert arrays.mask.size == sum(
        int(w) * c.size_px[1] for w, c in zip(arrays.words, cameras, strict=True)
    )
    assert arrays.edges.size == sum(c.size_px[0] * c.size_px[1] for c in cameras)


def test_a_camera_that_is_changed_in_one_frame_is_unchanged_in_the_next(cameras):
    seen = {c.name: observation(c, i) for i, c in enumerate(cameras)}
    first = lay_out_views(cameras, seen).arrays
    before = [values.copy() for values in (first.rotation, first.translation, first.intrinsics)]
    for values in (first.rotation, first.translation, first.intrinsics):
        values += 1.0
    again = lay_out_views(cameras, seen).arrays
    for values, unchanged in zip(
        (again.rotation, again.translation, again.intrinsics), before, strict=True
    ):
        np.testing.assert_array_equal(values, unchanged)


def test_a_camera_without_observation_is_left_out(cameras):
    views = lay_out_views(cameras, {"b": observation(cameras[1], 0)})
    assert views.names == ("b",)
    assert views.arrays.rotation.shape == (1, 3, 3)


def test_a_region_is_placed_in_the_full_frame(cameras):
    camera = cameras[0]
    full = observation(camera, 3)
    mask, edges = full.mask.copy(), full.edges.copy()
    keep = np.zeros(mask.shape, dtype=bool)
    keep[2:8, 5:69] = True
    mask[~keep] = False
    edges[~keep] = 0
    region = Observation.from_mask(
        "a", 0, mask[2:8, 5:69], edges[2:8, 5:69], size_px=camera.size_px, offset_px=(5, 2)
    )
    views = lay_out_views(cameras, {"a": region}).arrays
    np.testing.assert_array_equal(views.mask, pack_mask(mask).T.ravel())
    np.testing.assert_array_equal(views.edges, edges.ravel())
    assert views.observed[0] == mask.sum()


def test_no_view_is_refused_naming_what_came_and_what_was_expected(cameras):
    with pytest.raises(ImageError, match=r"of no camera, expected some of a, b, c"):
        lay_out_views(cameras, {})
    with pytest.raises(ImageError, match=r"observations of z, expected some of a, b, c"):
        lay_out_views(cameras, {"z": replace(observation(cameras[0], 0), camera="z")})


def test_a_frame_of_another_size_is_refused_naming_the_camera(cameras):
    wrong = observation(cameras[1], 0)
    with pytest.raises(ImageError, match=r"^a: observation of a 33x20 px frame.*says 70x9 px$"):
        lay_out_views(CameraRig(cameras).cameras, {"a": wrong})


def test_a_body_of_too_many_cones_is_refused_naming_it(body):
    many = replace(body, cone_names=tuple(f"c{i}" for i in range(LANES + 1)))
    with pytest.raises(
        BodyModelError, match=rf"body {body.name}: 65 cones, expected 64 at the most"
    ):
        body_arrays(many)
