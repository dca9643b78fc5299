import re

import numpy as np
import pytest
from sensor_msgs.msg import CameraInfo, RegionOfInterest

from markerless_tracker.camera import CameraModel
from markerless_tracker.errors import CalibrationError
from markerless_tracker.node.ros.camera_info import camera_of, check_info, info_of
from markerless_tracker.node.ros.stamps import stamp_of


@pytest.fixture
def camera() -> CameraModel:
    matrix = np.array([[500.0, 0, 320], [0, 510, 240], [0, 0, 1]])
    T = np.eye(4)
    T[:3, 3] = (0.1, 0.2, 3.0)
    return CameraModel("cam03", (640, 480), matrix, np.array([0.1, -0.2, 0.01, 0.02, 0.3]), T)


def test_round_trip(camera: CameraModel) -> None:
    info = info_of(camera, 1_500_000_000)
    assert info.header.frame_id == "cam03_optical_frame" and stamp_of(info) == 1_500_000_000
    assert list(info.p)[:3] == [500.0, 0.0, 320.0] and list(info.p)[3] == 0.0
    back = camera_of("cam03", info, camera.T_cam_world, "cam03/camera_info")
    assert back.size_px == camera.size_px
    np.testing.assert_array_equal(back.matrix, camera.matrix)
    np.testing.assert_array_equal(back.distortion, camera.distortion)
    np.testing.assert_array_equal(back.T_cam_world, camera.T_cam_world)


def test_a_lens_may_be_left_out(camera: CameraModel) -> None:
    info = info_of(camera, 0)
    info.d, info.distortion_model = [], ""
    assert not camera_of("cam03", info, camera.T_cam_world, "cam03/camera_info").distortion.any()


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"k": [0.0] * 9}, "uncalibrated"),
        ({"distortion_model": "equidistant"}, "'equidistant'.*plumb_bob"),
        ({"binning_x": 2}, "binning"),
        ({"d": [0.1] * 8}, "8 distortion coefficients"),
        ({"width": 0}, "size 0x480"),
        ({"d": [float("nan")] * 5}, "not finite"),
    ],
)
def test_what_cannot_be_used_names_the_camera(camera: CameraModel, change: dict, says: str) -> None:
    info = info_of(camera, 0)
    for name, value in change.items():
        setattr(info, name, value)
    with pytest.raises(CalibrationError, match=rf"cam03.*{says}"):
        camera_of("cam03", info, camera.T_cam_world, "cam03/camera_info")


def test_what_agrees_or_says_nothing_is_fine(camera: CameraModel) -> None:
    assert check_info(info_of(camera, 0), camera, "cam03/camera_info") == ""
    assert check_info(CameraInfo(), camera, "cam03/camera_info") == ""
    near = info_of(camera, 0)
    near.k[0] *= 1.005
    near.d[0] *= 1.005
    assert check_info(near, camera, "cam03/camera_info") == ""


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (
            {"k": [520.0, 0.0, 320.0, 0.0, 510.0, 240.0, 0.0, 0.0, 1.0]},
            r"K is \[520 0 320 .*says \[500 0 320 ",
        ),
        ({"k": [500.0, 0.0, 320.0, 0.0, 510.0, 250.0, 0.0, 0.0, 1.0]}, "K is .* 250"),
        ({"d": [0.1, -0.3, 0.01, 0.02, 0.3]}, r"D is \[0.1 -0.3 .*says \[0.1 -0.2 "),
        ({"d": []}, r"D is \[0 0 0 0 0\]"),
    ],
)
def test_what_differs_is_reported(camera: CameraModel, change: dict, says: str) -> None:
    info = info_of(camera, 0)
    for name, value in change.items():
        setattr(info, name, value)
    note = check_info(info, camera, "cam03/camera_info")
    assert re.search(rf"^cam03/camera_info: {says}", note) and "\n" not in note


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"width": 320, "height": 240}, "says 320x240 px.*640x480"),
        ({"d": [float("nan")] * 5}, "not finite"),
        ({"k": [float("nan")] * 9}, "not finite"),
        ({"distortion_model": "equidistant"}, "'equidistant'.*plumb_bob"),
        ({"distortion_model": "x" * 2000}, "'x{80}'"),
        ({"binning_y": 2}, "binning"),
        ({"roi": RegionOfInterest(width=100, height=100)}, "region of interest"),
    ],
)
def test_what_cannot_be_right_is_refused(camera: CameraModel, change: dict, says: str) -> None:
    info = info_of(camera, 0)
    for name, value in change.items():
        setattr(info, name, value)
    with pytest.raises(CalibrationError, match=rf"cam03/camera_info: .*{says}.*left out until"):
        check_info(info, camera, "cam03/camera_info")
