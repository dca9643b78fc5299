"""Cameras around a subject."""

import numpy as np

from markerless_tracker.camera import CameraModel, CameraRig
from markerless_tracker.errors import ConfigError
from markerless_tracker.geometry import FloatArray, inverse, transform

MOST_CAMERAS = 99
"""Names have two digits."""
MILD_LENS = (-0.08, 0.03, 0.0008, -0.0006, 0.0)
"""Distortion k1 k2 p1 p2 k3 of an ordinary wide lens: some px at the corners."""


def check_range(name: str, value: float, least: float, most: float) -> None:
    """Check that an argument of a scene lies in a range.

    Raises:
        ConfigError: it does not; names it.
    """
    if not least <= value <= most:
        raise ConfigError(f"{name} is {value:g}, expected {least:g} to {most:g}")


def check_fps(fps: float) -> None:
    """Check the frame rate of a scene, 1/s.

    Raises:
        ConfigError: it is impossible.
    """
    check_range("fps", fps, 0.1, 1000.0)


def check_cameras(
    cameras: int, size_px: tuple[int, int], fps: float, seed: int, noise: float
) -> None:
    """Check the arguments that all scenes have.

    Raises:
        ConfigError: one of them is impossible; names it.
    """
    check_range("cameras", cameras, 1, MOST_CAMERAS)
    check_range("image width", size_px[0], 16, 8192)
    check_range("image height", size_px[1], 16, 8192)
    check_fps(fps)
    check_range("noise", noise, 0.0, 100.0)
    check_range("seed", seed, 0, 2**63)


def look_at(eye_m: FloatArray, target_m: FloatArray) -> FloatArray:
    """``T_cam_world`` (4, 4) of a camera at a point (3,) that looks at another, upright."""
    forward = np.asarray(target_m, dtype=float) - np.asarray(eye_m, dtype=float)
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    down = np.cross(forward, right)
    return inverse(transform(np.column_stack([right, down, forward]), eye_m))


def ring_rig(
    cameras: int = 4,
    size_px: tuple[int, int] = (656, 490),
    *,
    distance_m: float = 4.5,
    height_m: float = 1.9,
    target_m: tuple[float, float, float] = (0.0, 0.0, 0.85),
    distortion: tuple[float, ...] = MILD_LENS,
) -> CameraRig:
    """Cameras cam01.. evenly around a target, which see about 3 m across their shorter side.

    Heights alternate by 0.3 m, so that no two opposite cameras see the same outline.
    """
    focal = 1.4 * min(size_px)
    matrix = np.array(
        [
            [focal, 0.0, 0.5 * (size_px[0] - 1)],
            [0.0, focal, 0.5 * (size_px[1] - 1)],
            [0.0, 0.0, 1.0],
        ]
    )
    models = []
    for i in range(cameras):
        azimuth = 2.0 * np.pi * (i + 0.35) / cameras
        eye = np.array(target_m) + distance_m * np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
        eye[2] = height_m + (0.15 if i // 2 % 2 else -0.15)
        pose = look_at(eye, np.array(target_m))
        models.append(CameraModel(f"cam{i + 1:02d}", size_px, matrix, np.array(distortion), pose))
    return CameraRig(tuple(models))
