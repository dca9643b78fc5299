"""Projection compared with OpenCV, scaling, and invalid cameras."""

import cv2
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from markerless_tracker.body import load_body
from markerless_tracker.camera import CameraModel, CameraRig, project, project_camera, scaled_size
from markerless_tracker.camera.lens import distort, lens
from markerless_tracker.drawing import silhouette
from markerless_tracker.errors import CalibrationError
from markerless_tracker.geometry import apply, rotation_from_rodrigues, transform

MATRIX = np.array([[1668.9, 0.0, 529.1], [0.0, 1681.1, 948.1], [0.0, 0.0, 1.0]])


def camera(
    *, name: str = "cam01", rotation=(1.2, -0.4, 0.3), translation=(0.1, 0.2, 3.0), lens=(0,) * 5
) -> CameraModel:
    return CameraModel(
        name,
        (1080, 1920),
        MATRIX,
        np.array(lens, dtype=float),
        transform(rotation_from_rodrigues(rotation), translation),
    )


angles = st.floats(-3.0, 3.0)
small = st.floats(-0.1, 0.1)


@given(
    st.tuples(angles, angles, angles),
    st.lists(
        st.tuples(st.floats(-0.8, 0.8), st.floats(-0.8, 0.8), st.floats(0.5, 8.0)), min_size=1
    ),
    st.tuples(small, small, small, small, small),
)
def test_projection_agrees_with_opencv(rotation, local, lens) -> None:
    view = camera(rotation=rotation, lens=lens)
    depth = np.array(local)[:, 2:]
    k1, k2, _, _, k3 = lens
    r2 = np.linspace(0.0, (np.array(local)[:, :2] ** 2).sum(axis=1), 100)
    assume((1.0 + 3.0 * k1 * r2 + 5.0 * k2 * r2**2 + 7.0 * k3 * r2**3 > 1e-3).all())
    points_cam = np.hstack([np.array(local)[:, :2] * depth, depth])
    points_world = points_cam @ view.T_world_cam[:3, :3].T + view.T_world_cam[:3, 3]
    expected, _ = cv2.projectPoints(
        points_world,
        np.array(rotation, dtype=float),
        view.T_cam_world[:3, 3],
        MATRIX,
        np.array(lens),
    )
    np.testing.assert_allclose(
        project_camera(points_world, view), expected[:, 0], rtol=1e-7, atol=1e-5
    )


@given(st.floats(0.0, 6.28), st.floats(0.0, 89.0), st.floats(-0.5, -0.05))
def test_no_point_far_beside_a_camera_is_projected_into_its_image(around, beside, k1) -> None:
    matrix = np.array([[500.0, 0.0, 320.0], [0.0, 500.0, 240.0], [0.0, 0.0, 1.0]])
    view = CameraModel("cam01", (641, 481), matrix, np.array([k1, 0, 0, 0, 0]), np.eye(4))
    tangent = np.tan(np.radians(beside))
    point = np.array([[tangent * np.cos(around), tangent * np.sin(around), 1.0]])
    u, v = project_camera(point, view)[0] - (320.0, 240.0)
    turning = np.sqrt(-1.0 / (3.0 * k1))
    if tangent < 0.999 * turning:
        assert np.hypot(u, v) == pytest.approx(500.0 * tangent * (1.0 + k1 * tangent**2))
    elif tangent > 1.001 * turning:
        assert np.hypot(u, v) > 100.0 * 500.0 * turning


@given(
    st.floats(-0.6, 0.2), st.floats(-0.2, 0.3), st.floats(-0.1, 0.1) | st.just(0.0),
    st.floats(0.0, 80.0),
)  # fmt: skip
def test_points_beyond_a_fall_of_the_lens_are_outside(k1, k2, k3, beside) -> None:
    """Also where the distorted distance rises again."""
    tangent = np.tan(np.radians(beside))
    s = np.linspace(0.0, tangent**2, 20001)
    slope = 1.0 + s * (3.0 * k1 + s * (5.0 * k2 + s * 7.0 * k3))
    assume(abs(slope.min()) > 1e-3 * (1.0 + tangent**4))
    u, v = lens(tangent, 0.0, np.array([k1, k2, 0.0, 0.0, k3]))
    r2 = tangent**2
    expected = tangent * (1.0 + r2 * (k1 + r2 * (k2 + r2 * k3)))
    assert u == (pytest.approx(expected) if slope.min() > 0.0 else 1e3 * tangent)
    assert v == 0.0


@given(st.integers(0, 2**32 - 1), st.integers(0, 12), st.sampled_from([0.4, 20.0]))
def test_many_points_are_distorted_like_each_of_them(seed, count, farthest) -> None:
    rng = np.random.default_rng(seed)
    k = rng.uniform((-0.4, -0.2, -0.01, -0.01, -0.1), (0.2, 0.3, 0.01, 0.01, 0.1))
    points = rng.uniform(-farthest, farthest, (2, 16))
    u, v = points.copy()
    distort(count, 16, u, v, k)
    expected = [lens(a, b, k) for a, b in points[:, :count].T]
    np.testing.assert_array_equal(np.stack([u, v], axis=1)[:count], np.reshape(expected, (-1, 2)))


def test_a_body_far_beside_a_camera_is_not_drawn_into_its_image() -> None:
    matrix = np.array([[500.0, 0.0, 320.0], [0.0, 500.0, 240.0], [0.0, 0.0, 1.0]])
    level = np.array([[0.0, -1.0, 0.0, 0.0], [0.0, 0.0, -1.0, 1.2], [1.0, 0.0, 0.0, 0.0],
                      [0.0, 0.0, 0.0, 1.0]])  # fmt: skip
    view = CameraModel("cam01", (640, 480), matrix, np.array([-0.3, 0, 0, 0, 0]), level)
    body = load_body("person31", 1.75)
    pose = body.neutral.copy()
    pose[body.root_position] = (1.0, 2.0, 1.0)
    assert not silhouette(body, pose, view).any()
    pose[body.root_position] = (4.0, 0.0, 1.0)
    assert silhouette(body, pose, view).any()


def test_points_behind_the_camera_are_nan() -> None:
    view = camera(rotation=(0, 0, 0), translation=(0, 0, 0))
    pixels = project_camera(np.array([[0, 0, 2.0], [0, 0, -2.0], [0, 0, 0.0]]), view)
    np.testing.assert_allclose(pixels[0], MATRIX[:2, 2])
    assert np.isnan(pixels[1:]).all()


def test_a_rig_projects_with_every_camera() -> None:
    rig = CameraRig((camera(), camera(name="cam02", translation=(0.5, 0.0, 4.0), lens=(0.1,) * 4)))
    points = np.array([[0.1, 0.2, 0.3], [0.0, 0.4, 1.0]])
    pixels = project(points, rig)
    assert pixels.shape == (2, 2, 2)
    np.testing.assert_array_equal(pixels[1], project_camera(points, rig["cam02"]))


def test_a_rig_in_another_world_sees_the_same() -> None:
    rig = CameraRig((camera(), camera(name="cam02", translation=(0.5, 0.0, 4.0), lens=(0.1,) * 4)))
    T_new_old = transform(rotation_from_rodrigues([0.4, -0.2, 1.1]), [3.0, -1.0, 0.5])
    points = np.array([[0.1, 0.2, 0.3], [0.0, 0.4, 1.0]])
    moved = project(apply(T_new_old, points), rig.moved(T_new_old))
    np.testing.assert_allclose(moved, project(points, rig), atol=1e-9)


def test_a_shifted_camera_sees_everything_so_far_away() -> None:
    """After the lens, so by the same distance everywhere in the image."""
    rig = CameraRig((camera(), camera(name="cam02", lens=(0.1, -0.2, 0.01, 0.02))))
    points = np.array([[0.1, 0.2, 0.3], [0.0, 0.4, 1.0], [-0.5, 0.3, 0.2]])
    shifted = rig.shifted({"cam02": (7.5, -3.0)})
    assert shifted["cam01"] is rig["cam01"]
    moved = project(points, shifted)[1] - project(points, rig)[1]
    np.testing.assert_allclose(moved, np.tile([7.5, -3.0], (3, 1)), atol=1e-9)


@given(st.floats(0.05, 1.0))
def test_scaling_agrees_with_area_averaging(scale: float) -> None:
    view = camera(lens=(-0.05, 0.1, 0.001, 0.002, 0.0))
    scaled = view.scaled(scale)
    points = np.array([[0.2, -0.1, 0.4], [0.0, 0.3, 0.0]])
    factor = np.array(scaled.size_px) / np.array(view.size_px)
    expected = (project_camera(points, view) + 0.5) * factor - 0.5
    np.testing.assert_allclose(project_camera(points, scaled), expected, atol=1e-6)
    assert scaled.size_px == scaled_size(view.size_px, scale)


def test_halving_twice_is_quartering() -> None:
    np.testing.assert_allclose(
        camera().scaled(0.5).scaled(0.5).matrix, camera().scaled(0.25).matrix, atol=1e-9
    )


@pytest.mark.parametrize(
    ("change", "reported"),
    [
        ({"matrix": np.eye(2)}, "matrix"),
        ({"matrix": MATRIX * np.nan}, "matrix"),
        ({"matrix": -MATRIX}, "focal lengths"),
        ({"matrix": MATRIX.T}, "expected rows fx s cx, 0 fy cy, 0 0 1 .transposed"),
        ({"matrix": MATRIX + np.diag([0.0, 0.0, 1.0])}, "expected rows fx s cx"),
        ({"distortion": np.zeros(3)}, "3 distortion coefficients"),
        ({"T_cam_world": np.eye(4) * 2.0}, "rotation is .*2.0.* expected a rotation matrix"),
        ({"size_px": (0, 10)}, "0x10"),
    ],
)
def test_impossible_cameras_are_refused_by_name(change, reported) -> None:
    good = {
        "name": "cam07",
        "size_px": (10, 10),
        "matrix": MATRIX,
        "distortion": np.zeros(5),
        "T_cam_world": np.eye(4),
    }
    with pytest.raises(CalibrationError, match=reported) as error:
        CameraModel(**{**good, **change})
    assert "cam07" in str(error.value)


def test_a_rig_requires_distinct_names_and_finds_its_cameras() -> None:
    with pytest.raises(CalibrationError, match="distinct"):
        CameraRig((camera(), camera()))
    with pytest.raises(CalibrationError, match="cam09.*cam01"):
        CameraRig((camera(),))["cam09"]
    with pytest.raises(CalibrationError, match="at least one"):
        CameraRig(())
