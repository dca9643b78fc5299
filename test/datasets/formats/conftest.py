"""A rig and pictures of it, for recordings in every layout."""

import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import cv2
import numpy as np
import pytest

from markerless_tracker.camera import CameraModel, CameraRig
from markerless_tracker.datasets import Recording
from markerless_tracker.datasets.upright.axes import UNITS, rotation_to
from markerless_tracker.geometry import rodrigues_from_rotation, rotation_from_rodrigues, transform

# pytest before 8 gives packages of test folders no path to import other modules from.
package = sys.modules.setdefault(str(__package__), ModuleType(str(__package__)))
if not hasattr(package, "__path__"):
    package.__path__ = [str(Path(__file__).parent)]

SIZE = (32, 24)
FRAMES = 3
TRUTH_M = np.random.default_rng(6).uniform([-1.0, -1.0, 0.0], [1.0, 1.0, 1.8], (FRAMES, 28, 3))
"""Joints of the frames, world frame; a data set has some of the 28."""


def camera(name: str, turn: float) -> CameraModel:
    matrix = np.array([[40.0, 0.0, 15.5], [0.0, 41.0, 11.25], [0.0, 0.0, 1.0]])
    pose = transform(rotation_from_rodrigues([1.2, turn, -0.4]), [0.1, 0.2, 3.0 + turn])
    return CameraModel(name, SIZE, matrix, np.array([-0.1, 0.02, 0.001, -0.002, 0.003]), pose)


@pytest.fixture
def make_rig() -> Callable[..., CameraRig]:
    return lambda *names: CameraRig(tuple(camera(n, 0.3 * i) for i, n in enumerate(names)))


def picture(camera_number: int, frame: int) -> np.ndarray:
    rng = np.random.default_rng([camera_number, frame])
    return rng.integers(0, 256, (SIZE[1], SIZE[0], 3), dtype=np.uint8)


@pytest.fixture
def write_images() -> Callable[..., None]:
    """`write_images(folder, camera number, pattern)`: numbered images of a camera."""

    def write(folder: Path, number: int, pattern: str = "{:04d}.png", frames: int = FRAMES) -> None:
        folder.mkdir(parents=True)
        for frame in range(frames):
            assert cv2.imwrite(str(folder / pattern.format(frame)), picture(number, frame))

    return write


@pytest.fixture
def write_video() -> Callable[[Path, int], None]:
    """`write_video(path, camera number)`: a lossless video of a camera at 30 fps."""

    def write(path: Path, number: int) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"FFV1"), 30.0, SIZE)
        for frame in range(FRAMES):
            writer.write(picture(number, frame))
        writer.release()

    return write


@pytest.fixture
def check() -> Callable[[Recording, CameraRig], None]:
    """The recording has these cameras, and the pictures of camera i as its i-th."""

    def compare(recording: Recording, rig: CameraRig) -> None:
        assert recording.rig.names == rig.names
        for read, true in zip(recording.rig, rig, strict=True):
            assert read.size_px == true.size_px
            np.testing.assert_allclose(read.matrix, true.matrix, atol=1e-9)
            np.testing.assert_allclose(read.distortion, true.distortion, atol=1e-12)
            np.testing.assert_allclose(read.T_cam_world, true.T_cam_world, atol=1e-9)
        sets = list(recording.frames())
        assert len(sets) == FRAMES
        for frame in sets:
            for number, name in enumerate(rig.names):
                np.testing.assert_array_equal(frame.images[name], picture(number, frame.index))

    return compare


def cal_numbers(model: CameraModel, *, vector: bool = False) -> str:
    """A `.cal` of a camera, of 22 or 25 numbers."""
    K, T = model.matrix, model.T_cam_world
    rows = [
        [K[0, 0], K[1, 1]],
        [K[0, 2], K[1, 2]],
        [K[0, 1] / K[0, 0]],
        model.distortion,
        *T[:3, :3],
        1000.0 * T[:3, 3],
        *([rodrigues_from_rotation(T[:3, :3])] if vector else []),
    ]
    return "".join(" ".join(f"{value:.17g}" for value in row) + "\n" for row in rows)


def in_world_of(rig: CameraRig, *, up: str = "z", units: str = "m") -> CameraRig:
    """The rig as a data set states it whose world has another axis up and other units."""
    cameras = []
    for one in rig:
        T = one.T_cam_world
        stated = transform(T[:3, :3] @ rotation_to(up), T[:3, 3] / UNITS[units])
        cameras.append(CameraModel(one.name, one.size_px, one.matrix, one.distortion, stated))
    return CameraRig(tuple(cameras))


def points_of(points: np.ndarray, *, up: str = "z", units: str = "m") -> np.ndarray:
    """Points as such a data set states them."""
    return points @ rotation_to(up) / UNITS[units]


def with_lens(rig: CameraRig, distortion: list[float]) -> CameraRig:
    """The rig with other lenses."""
    return CameraRig(
        tuple(
            CameraModel(c.name, c.size_px, c.matrix, np.array(distortion), c.T_cam_world)
            for c in rig
        )
    )


def changed(path: Path, old: str, new: str) -> None:
    """Change every place of a text in a file."""
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new), encoding="utf-8")
