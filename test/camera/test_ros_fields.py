"""Cameras to and from the fields of a CameraInfo, and chains of transforms."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from markerless_tracker.camera import CameraModel
from markerless_tracker.camera.ros_fields import FrameTree, camera_info_fields, lens_of
from markerless_tracker.errors import CalibrationError
from markerless_tracker.geometry import (
    FloatArray,
    quaternion_from_rotation,
    rotation_from_rodrigues,
    transform,
)


@pytest.fixture
def camera() -> CameraModel:
    matrix = np.array([[500.0, 0.5, 320], [0, 510, 240], [0, 0, 1]])
    T = np.eye(4)
    T[:3, 3] = (0.1, 0.2, 3.0)
    return CameraModel("cam03", (640, 480), matrix, np.array([0.1, -0.2, 0.01, 0.02, 0.3]), T)


def info_of(camera: CameraModel, **changes: Any) -> Any:
    roi = SimpleNamespace(width=0, height=0)
    fields = {**camera_info_fields(camera), "binning_x": 0, "binning_y": 0, "roi": roi}
    return SimpleNamespace(**{**fields, **changes})


def test_a_lens_round_trips(camera: CameraModel) -> None:
    info = info_of(camera)
    assert (info.width, info.height) == camera.size_px
    assert np.reshape(info.p, (3, 4))[:, 3].tolist() == [0.0, 0.0, 0.0]
    matrix, distortion = lens_of(info, "topic")
    np.testing.assert_array_equal(matrix, camera.matrix)
    np.testing.assert_array_equal(distortion, camera.distortion)


@pytest.mark.parametrize(
    "changes",
    [
        {"d": [], "distortion_model": ""},
        {"d": np.zeros(8), "distortion_model": "rational_polynomial"},
    ],
)
def test_no_coefficients_mean_no_distortion(camera: CameraModel, changes) -> None:
    assert lens_of(info_of(camera, **changes), "topic")[1].tolist() == [0.0] * 5


def test_a_region_of_the_whole_image_is_none(camera: CameraModel) -> None:
    width, height = camera.size_px
    info = info_of(camera, roi=SimpleNamespace(width=width, height=height))
    np.testing.assert_array_equal(lens_of(info, "topic")[0], camera.matrix)


@pytest.mark.parametrize(
    ("changes", "reported"),
    [
        ({"k": np.zeros(9)}, "topic: K is zero"),
        ({"k": np.full(9, np.nan)}, "topic: K or D is not finite"),
        ({"distortion_model": "equidistant"}, "topic: distortion model 'equidistant'"),
        ({"distortion_model": "equidistant", "d": np.zeros(4)}, "topic: distortion model 'equi"),
        ({"d": np.full(8, 0.1)}, "topic: 8 distortion coefficients"),
        ({"binning_y": 2}, "topic: binning"),
        ({"roi": SimpleNamespace(width=320, height=480)}, "topic: .*region of interest"),
    ],
)
def test_what_is_not_supported_is_refused(camera: CameraModel, changes, reported: str) -> None:
    with pytest.raises(CalibrationError, match=reported):
        lens_of(info_of(camera, **changes), "topic")


def pose(seed: int) -> FloatArray:
    rng = np.random.default_rng(seed)
    return transform(rotation_from_rodrigues(rng.normal(size=3)), rng.normal(size=3))


def put(tree: FrameTree, parent: str, child: str, T: FloatArray) -> None:
    tree.put(parent, child, quaternion_from_rotation(T[:3, :3]).tolist(), T[:3, 3].tolist())


def test_a_chain_leads_to_its_root_and_to_every_ancestor() -> None:
    tree = FrameTree()
    put(tree, "map", "rig", pose(9))
    put(tree, "rig", "cam", pose(2))
    put(tree, "map", "rig", pose(1))  # the newest counts
    assert "cam" in tree and "map" not in tree
    for stop, ancestor, expected in (
        (None, "map", pose(1) @ pose(2)),
        ("rig", "rig", pose(2)),
        ("cam", "cam", np.eye(4)),
        ("elsewhere", "map", pose(1) @ pose(2)),
    ):
        found, T = tree.up("cam", stop)
        assert found == ancestor
        np.testing.assert_allclose(T, expected, atol=1e-12)


def test_a_cycle_is_refused() -> None:
    tree = FrameTree()
    put(tree, "a", "b", pose(1))
    put(tree, "b", "a", pose(2))
    with pytest.raises(CalibrationError, match="the transforms of a form a cycle"):
        tree.up("a")


@pytest.mark.parametrize(
    ("quaternion", "translation"),
    [
        ((0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
        ((1.0, np.nan, 0.0, 0.0), (0.0, 0.0, 0.0)),
        ((1.0, 0.0, 0.0, 0.0), (np.inf, 0.0, 0.0)),
    ],
)
def test_invalid_transforms_are_refused(quaternion, translation) -> None:
    tree = FrameTree()
    with pytest.raises(CalibrationError, match="transform map -> cam: .*non-zero quaternion"):
        tree.put("map", "cam", quaternion, translation)
    assert "cam" not in tree
