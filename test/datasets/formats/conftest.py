"""A rig and pictures of it, for recordings in every layout."""

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from markerless_tracker.camera import CameraModel, CameraRig
from markerless_tracker.datasets import Recording
from markerless_tracker.geometry import rodrigues_from_rotation, rotation_from_rodrigues, transform

SIZE = (32, 24)
FRAMES = 3


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
