"""The triangulation that the peer's landmarks get: exact, and without the view that is wrong."""

import importlib.util
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from markerless_tracker.camera import CameraModel, CameraRig, project
from markerless_tracker.datasets import open_recording
from markerless_tracker.synthesis.rig import ring_rig


@pytest.fixture(scope="module")
def triangulation(project_root: Path) -> ModuleType:
    path = project_root / "bench" / "peer" / "triangulation.py"
    spec = importlib.util.spec_from_file_location("triangulation", path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def rig() -> CameraRig:
    """Four cameras with lenses that distort."""
    lens = np.array([-0.1, 0.03, 0.001, -0.002, 0.0])
    return CameraRig(
        tuple(
            CameraModel(c.name, c.size_px, c.matrix, lens, c.T_cam_world)
            for c in ring_rig(4, (640, 480))
        )
    )


def seen(rig: CameraRig, points: np.ndarray) -> np.ndarray:
    """(1, views, 33, 3) landmarks of one frame, the points from number 11 on."""
    found = np.full((1, len(rig), 33, 3), 0.9)
    found[0, :, :, :2] = 5.0
    found[0, :, 11 : 11 + len(points), :2] = project(points, rig)
    return found


def test_joints_of_a_frame(triangulation, rig, make_recording) -> None:
    recording = open_recording(make_recording())
    recording.rig = rig
    points = np.random.default_rng(1).uniform([-0.5, -0.5, 0.2], [0.5, 0.5, 1.8], (18, 3))
    track = triangulation.joint_track(seen(rig, points), recording)
    assert len(track.names) == 12 and track.stamps_ns.tolist() == [0]
    for column, name in enumerate(track.names):
        true = points[triangulation.JOINTS[name] - 11]
        np.testing.assert_allclose(track.positions_m[0, column], true, atol=1e-5)
    assert track.names[:2] == ("LShoulder", "RShoulder")
    nobody = triangulation.joint_track(np.full((2, 4, 33, 3), np.nan), recording)
    assert not nobody.tracked.any() and nobody.stamps_ns[1] == 16666667


def test_a_view_that_is_wrong_does_not_count(triangulation, rig) -> None:
    point = np.array([0.2, -0.1, 1.1])
    pixels = project(point[None], rig)[:, 0]
    pixels[2] += [90.0, -40.0]

    def found(weights: list[float]) -> np.ndarray:
        rays = [
            triangulation.undistorted(pixel[None], camera)[0]
            for pixel, camera in zip(pixels, rig, strict=True)
        ]
        return triangulation.consistent(np.array(rays), pixels, np.array(weights), rig)

    np.testing.assert_allclose(found([0.9, 0.9, 0.9, 0.9]), point, atol=1e-5)
    np.testing.assert_allclose(found([0.9, 0.9, 0.0, 0.9]), point, atol=1e-5)
    # Three views are never reduced to two, which always agree somehow.
    assert np.linalg.norm(found([0.9, 0.9, 0.9, 0.0]) - point) > 0.01
    assert np.isnan(found([0.9, 0.0, 0.0, 0.0])).all()
