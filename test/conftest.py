"""Fixtures for every room: recordings that may lie beside the project."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

# ruff: noqa: E402
from markerless_tracker.libraries import single_threaded

# As the programs do, before NumPy is imported: the tests' matrices are as small as theirs.
single_threaded()

import numpy as np
import pytest
from hypothesis import settings

from markerless_tracker.body import MARKER_NAMES
from markerless_tracker.camera import CameraModel, CameraRig
from markerless_tracker.datasets import MarkerTrack, new_recording
from markerless_tracker.geometry import rotation_from_rodrigues, transform
from markerless_tracker.synthesis import SyntheticScene

# Property tests have no deadline: no test depends on the speed of the machine.
settings.register_profile("untimed", deadline=None)
settings.load_profile("untimed")

ROOT = Path(__file__).resolve().parent.parent
SHARED_DATA = ROOT.parent / "shared" / "data"


@pytest.fixture(scope="session")
def project_root() -> Path:
    """Folder of the source tree."""
    return ROOT


def _recording(name: str) -> Path:
    folder = SHARED_DATA / name
    if not (folder / "calibration.toml").is_file():
        pytest.skip(f"the recording {name} is not on this machine (looked in {SHARED_DATA})")
    return folder


@pytest.fixture(scope="session")
def balance_real() -> Path:
    """Folder of a real recording, in the neutral layout."""
    return _recording("balance_real")


@pytest.fixture(scope="session")
def render_walk() -> Path:
    """Folder of a rendered recording with exact masks, in the neutral layout."""
    return _recording("render_walk")


@pytest.fixture
def make_recording(tmp_path: Path) -> Callable[..., Path]:
    """Writes a small recording folder (two cameras, lossless video, deterministic noise).

    `make_recording(name, frames=, fps=, backgrounds=, size_px=)` returns its folder; backgrounds is
    how many empty-scene images each camera gets.
    """

    def make(
        name: str = "small",
        *,
        frames: int = 6,
        fps: float = 60.0,
        backgrounds: int = 1,
        size_px: tuple[int, int] = (64, 48),
    ) -> Path:
        rng = np.random.default_rng(7)
        shape = (size_px[1], size_px[0], 3)
        matrix = np.array([[80.0, 0.0, 31.123456789], [0.0, 81.0, 23.987654321], [0, 0, 1]])
        cameras = [
            CameraModel(
                camera,
                size_px,
                matrix,
                np.array([-0.05, 0.1, 0.001, -0.002]),
                transform(rotation_from_rodrigues(rotation), [0.1, 0.2, 3.0]),
            )
            for camera, rotation in (("cam01", [1.2, 0.3, -0.4]), ("cam02", [1.1, -1.3, 0.7]))
        ]
        with new_recording(tmp_path / name, CameraRig(tuple(cameras)), fps, lossless=True) as out:
            for _ in range(frames):
                out.write({c.name: rng.integers(0, 256, shape, dtype=np.uint8) for c in cameras})
            for camera in cameras:
                empty = [rng.integers(0, 256, shape, np.uint8) for _ in range(backgrounds)]
                out.write_background(camera.name, empty)
        return tmp_path / name

    return make


@pytest.fixture(scope="session")
def walk(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Six frames at 30 Hz in four lossless views, `ground_truth.trc` beside them."""
    scene = SyntheticScene(
        body="balan31", motion="walk", size_px=(192, 144), fps=30.0, seed=4, noise=2.0
    )
    folder = tmp_path_factory.mktemp("made-up") / "walk"
    truth = MarkerTrack(
        MARKER_NAMES,
        np.array([scene.stamp_ns(i) for i in range(6)]),
        np.stack([scene.markers(i) for i in range(6)]),
    )
    with new_recording(folder, scene.rig, scene.fps, lossless=True) as recording:
        for name, images in scene.backgrounds(6).items():
            recording.write_background(name, images)
        for i in range(6):
            recording.write(scene.frame(i)[0])
        recording.write_truth(truth)
    return folder


@pytest.fixture(scope="session")
def search() -> dict[str, Any]:
    """Every setting of a quick search."""
    return {
        "body": "balan31",
        "optimizer": "sppso",
        "evaluations": 1000,
        "refinement": "contour",
        "refine.iterations": 3,
        "fit_shape": True,
        "prediction": 0.6,
        "sigma.scale": 0.5,
        "edge_weight": 0.5,
        "edges.rule": "outline",
        "limits": "anatomical",
        "collision": "elliptic",
        "seed": 1,
        "threads": 1,
    }
