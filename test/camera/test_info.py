"""Cameras to and from the fields of a CameraInfo."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from markerless_tracker.camera import CameraModel, camera_from_info, info_fields
from markerless_tracker.errors import CalibrationError


@pytest.fixture
def camera() -> CameraModel:
    matrix = np.array([[500.0, 0.5, 320], [0, 510, 240], [0, 0, 1]])
    T = np.eye(4)
    T[:3, 3] = (0.1, 0.2, 3.0)
    return CameraModel("cam03", (640, 480), matrix, np.array([0.1, -0.2, 0.01, 0.02, 0.3]), T)


def info_of(camera: CameraModel, **changes: Any) -> SimpleNamespace:
    roi = SimpleNamespace(width=0, height=0)
    fields = {**info_fields(camera), "binning_x": 0, "binning_y": 0, "roi": roi}
    return SimpleNamespace(**{**fields, **changes})


def test_a_camera_comes_back_with_the_same_numbers(camera: CameraModel) -> None:
    info = info_of(camera)
    assert info.p.reshape(3, 4)[:, 3].tolist() == [0.0, 0.0, 0.0]
    back = camera_from_info("cam03", info, camera.T_cam_world, where="topic")
    assert (back.name, back.size_px) == (camera.name, camera.size_px)
    for field in ("matrix", "distortion", "T_cam_world"):
        np.testing.assert_array_equal(getattr(back, field), getattr(camera, field))


@pytest.mark.parametrize(
    "changes",
    [
        {"d": [], "distortion_model": ""},
        {"d": np.zeros(8), "distortion_model": "rational_polynomial"},
    ],
)
def test_no_coefficients_mean_no_distortion(camera: CameraModel, changes) -> None:
    back = camera_from_info("cam03", info_of(camera, **changes), camera.T_cam_world, where="topic")
    assert not back.is_distorted


def test_a_region_of_the_whole_image_is_accepted(camera: CameraModel) -> None:
    info = info_of(camera, roi=SimpleNamespace(width=640, height=480))
    assert camera_from_info("cam03", info, camera.T_cam_world, where="topic").size_px == (640, 480)


@pytest.mark.parametrize(
    ("changes", "reported"),
    [
        ({"k": np.zeros(9)}, "topic: K is zero"),
        ({"distortion_model": "equidistant"}, "topic: distortion model 'equidistant'"),
        ({"d": np.full(8, 0.1)}, "8 distortion coefficients"),
        ({"binning_y": 2}, "topic: binning"),
        ({"roi": SimpleNamespace(width=320, height=480)}, "region of interest"),
        ({"width": 0}, "size 0x480"),
    ],
)
def test_what_is_not_supported_is_refused(camera: CameraModel, changes, reported: str) -> None:
    with pytest.raises(CalibrationError, match=reported):
        camera_from_info("cam03", info_of(camera, **changes), camera.T_cam_world, where="topic")
