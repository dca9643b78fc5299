"""What is said about unusual calibrations, and that nothing is said about usual ones."""

from dataclasses import replace

import numpy as np
import pytest

from markerless_tracker.camera import CameraModel, CameraRig, read_calibration
from markerless_tracker.camera.doubts import calibration_doubts
from markerless_tracker.geometry import inverse, rotation_from_rodrigues, transform
from markerless_tracker.synthesis import ring_rig
from markerless_tracker.synthesis.rig import look_at

SIZE_PX = (256, 192)


def ring(**options: float) -> CameraRig:
    return ring_rig(4, SIZE_PX, **options)


def changed(rig: CameraRig, name: str, **values: object) -> CameraRig:
    """The rig with attributes of one camera replaced."""
    return CameraRig(tuple(replace(c, **values) if c.name == name else c for c in rig))


def moved(rig: CameraRig, move: np.ndarray) -> CameraRig:
    """The rig in another world; `move` takes points of the old one to it."""
    return CameraRig(tuple(replace(c, T_cam_world=c.T_cam_world @ inverse(move)) for c in rig))


def turned(x: float) -> np.ndarray:
    return transform(rotation_from_rodrigues(np.array([x, 0.0, 0.0])), [0.0, 0.0, 0.0])


@pytest.mark.parametrize(
    "rig",
    [
        ring_rig(1, SIZE_PX),
        ring_rig(2, SIZE_PX),
        ring(),
        ring(height_m=0.4),
        ring(height_m=4.5, distance_m=2.0),
        ring_rig(8, SIZE_PX, distance_m=12.0),
    ],
)
def test_nothing_about_usual_rigs(rig: CameraRig) -> None:
    assert calibration_doubts(rig) == ()


@pytest.mark.parametrize("name", ["balance_real", "render_walk"])
def test_nothing_about_real_rigs(name: str, request: pytest.FixtureRequest) -> None:
    folder = request.getfixturevalue(name)
    assert calibration_doubts(read_calibration(folder / "calibration.toml")) == ()


def test_cameras_that_look_straight_down_say_nothing_about_up() -> None:
    eyes = [np.array([x, y, 4.0]) for x, y in ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0))]
    poses = [look_at(eye, eye + np.array([0.05, 0.0, -4.0])) for eye in eyes]
    matrix = ring().cameras[0].matrix
    cameras = [
        CameraModel(f"cam{i}", SIZE_PX, matrix, np.zeros(5), pose) for i, pose in enumerate(poses)
    ]
    assert calibration_doubts(CameraRig(tuple(cameras))) == ()


@pytest.mark.parametrize(
    ("factor", "says"),
    [
        (1000.0, "in millimetres instead of metres"),
        (100.0, "in centimetres instead of metres"),
        (0.001, "at most 0.009 m apart"),
    ],
)
def test_units(factor: float, says: str) -> None:
    cameras = []
    for camera in ring():
        T = camera.T_cam_world.copy()
        T[:3, 3] *= factor
        cameras.append(replace(camera, T_cam_world=T))
    (line,) = calibration_doubts(CameraRig(tuple(cameras)))
    assert says in line


@pytest.mark.parametrize(
    ("move", "axis"),
    [(turned(-0.5 * np.pi), "+y"), (turned(0.5 * np.pi), "-y"), (turned(np.pi), "-z")],
)
def test_axes(move: np.ndarray, axis: str) -> None:
    doubts = calibration_doubts(moved(ring(), move))
    assert f"up in the images is about the world's {axis} axis" in doubts[0]


def test_one_camera_upside_down() -> None:
    rig = ring()
    roll = transform(rotation_from_rodrigues(np.array([0.0, 0.0, np.pi])), [0.0, 0.0, 0.0])
    rolled = changed(rig, "cam02", T_cam_world=roll @ rig["cam02"].T_cam_world)
    assert calibration_doubts(rolled) == ("calibration: cam02: upside down",)


def test_cameras_below_the_floor() -> None:
    low = moved(ring(), transform(np.eye(3), [0.0, 0.0, -1.9]))
    (line,) = calibration_doubts(low)
    assert line.startswith("calibration: below the floor, z = 0: cam01 by 0.15 m, cam02 by 0.15 m")


def test_a_camera_that_looks_away() -> None:
    rig = ring()
    eye = rig["cam03"].T_world_cam[:3, 3]
    away = changed(rig, "cam03", T_cam_world=look_at(eye, 2.0 * eye))
    (line,) = calibration_doubts(away)
    assert line.startswith("calibration: cam03: nothing in view that 2 other camera(s) see")


def test_a_principal_point_of_another_image_size() -> None:
    rig = ring()
    matrix = rig["cam01"].matrix.copy()
    matrix[:2, 2] *= 2.0
    (line,) = calibration_doubts(changed(rig, "cam01", matrix=matrix))
    assert "cam01: principal point (255, 191) far from the middle of images of 256x192" in line
