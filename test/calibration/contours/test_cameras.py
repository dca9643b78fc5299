"""Changes of cameras and their effect on residuals."""

from collections.abc import Callable

import numpy as np
import pytest

from markerless_tracker.calibration.contours.cameras import (
    CHANGES,
    change_between,
    change_jacobian,
    moved,
    put,
    shift_jacobian,
)
from markerless_tracker.camera import CameraModel, project_camera
from markerless_tracker.fitness.arrays import camera_arrays
from markerless_tracker.geometry import FloatArray
from markerless_tracker.synthesis.rig import ring_rig

LENS = (-0.15, 0.06, 0.002, -0.0015, 0.01)
CHANGE = np.array([0.02, -0.03, 0.01, 0.04, -0.02, 0.05, 0.015])
STEP = 1e-6


@pytest.fixture(scope="module")
def camera() -> CameraModel:
    return ring_rig(3, (656, 490), distortion=LENS).cameras[1]


@pytest.fixture(scope="module")
def points() -> FloatArray:
    return np.random.default_rng(3).uniform([-0.8, -0.8, 0.0], [0.8, 0.8, 1.8], (40, 3))


@pytest.fixture(scope="module")
def normals() -> FloatArray:
    angle = np.random.default_rng(4).uniform(0.0, 2.0 * np.pi, 40)
    return np.column_stack([np.cos(angle), np.sin(angle)])


def gradient(of: Callable[[FloatArray], FloatArray], at: FloatArray) -> FloatArray:
    """Central differences (n, k) of values (n,) by k numbers."""
    steps = STEP * np.eye(at.size)
    return np.stack([(of(at + step) - of(at - step)) / (2.0 * STEP) for step in steps], axis=1)


def test_a_change_is_found_again(camera) -> None:
    np.testing.assert_allclose(change_between(camera, moved(camera, CHANGE)), CHANGE, atol=1e-12)
    np.testing.assert_array_equal(change_between(camera, camera), np.zeros(CHANGES))


def test_the_centre_moves_along_the_cameras_axes(camera) -> None:
    there = moved(camera, np.array([0.3, -0.2, 0.1, 0.5, 0.0, 0.0, 0.0]))
    shift = there.T_world_cam[:3, 3] - camera.T_world_cam[:3, 3]
    np.testing.assert_allclose(shift, 0.5 * camera.T_world_cam[:3, 0], atol=1e-12)


def test_derivatives_by_a_change(camera, points, normals) -> None:
    def value(change: FloatArray) -> FloatArray:
        return np.einsum("ni,ni->n", normals, project_camera(points, moved(camera, change)))

    by_point = np.stack(
        [
            gradient(
                lambda at, n=n: project_camera(at[None], camera)[0] @ normals[n : n + 1].T,
                points[n],
            )[0]
            for n in range(len(points))
        ]
    )
    expected = gradient(value, np.zeros(CHANGES))
    np.testing.assert_allclose(
        change_jacobian(camera, points, by_point), expected, rtol=1e-4, atol=1e-3
    )
    np.testing.assert_allclose(shift_jacobian(camera, points, by_point), normals, atol=1e-5)


def test_kernels_get_the_changed_camera(camera) -> None:
    there = moved(camera, CHANGE)
    arrays, wanted = camera_arrays([camera, camera]), camera_arrays([camera, there])
    put(arrays, 1, there)
    for name in ("rotation", "translation", "intrinsics", "distortion"):
        np.testing.assert_array_equal(getattr(arrays, name), getattr(wanted, name))
