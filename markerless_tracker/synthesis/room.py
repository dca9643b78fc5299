"""The empty room that a camera sees: a textured floor and four walls around a shared centre."""

import cv2
import numpy as np
from numpy.typing import NDArray

from markerless_tracker.camera import CameraModel
from markerless_tracker.geometry import FloatArray

_TEXTURE_PX = 512
_TEXTURE_M = 4.0
_FLOOR, _WALL = (120.0, 140.0, 150.0), (175.0, 185.0, 180.0)
_CONTRAST = 14.0


def room_picture(camera: CameraModel, half_width_m: float, seed: int) -> NDArray[np.float32]:
    """Picture (h, w, 3) BGR float32 of a square room with its floor at z = 0.

    All cameras with the same seed see the same room; half_width_m is the distance of its walls
    from the centre, and must hold the camera.
    """
    rng = np.random.default_rng([seed, 1])
    textures = [_texture(rng, base) for base in (_FLOOR, _WALL, _WALL, _WALL, _WALL)]
    width, height = camera.size_px
    centre, rays = _rays(camera)
    nearest = np.full((height, width), np.inf)
    picture = np.zeros((height, width, 3), dtype=np.float32)
    surfaces = [(2, 0.0)] + [(axis, sign * half_width_m) for axis in (0, 1) for sign in (-1.0, 1.0)]
    for texture, (axis, level) in zip(textures, surfaces, strict=True):
        with np.errstate(divide="ignore", invalid="ignore"):
            distance = (level - centre[axis]) / rays[..., axis]
        hit = (distance > 0.0) & (distance < nearest)
        nearest[hit] = distance[hit]
        points = centre + np.where(hit, distance, 0.0)[..., None] * rays
        across, along = [a for a in range(3) if a != axis]
        scale = _TEXTURE_PX / _TEXTURE_M
        sampled = cv2.remap(
            texture,
            np.mod(points[..., across] * scale, _TEXTURE_PX - 1).astype(np.float32),
            np.mod(points[..., along] * scale, _TEXTURE_PX - 1).astype(np.float32),
            cv2.INTER_LINEAR,
        )
        picture[hit] = sampled[hit]
    return picture


def _rays(camera: CameraModel) -> tuple[FloatArray, FloatArray]:
    """The camera's centre (3,) and the directions (h, w, 3) of its pixels, world frame."""
    width, height = camera.size_px
    u, v = np.meshgrid(np.arange(width, dtype=float), np.arange(height, dtype=float))
    pixels = np.stack([u.ravel(), v.ravel()], axis=1)[:, None]
    flat = cv2.undistortPoints(pixels, camera.matrix, camera.distortion)[:, 0]
    rays = np.column_stack([flat, np.ones(len(flat))]) @ camera.T_world_cam[:3, :3].T
    return camera.T_world_cam[:3, 3], rays.reshape(height, width, 3)


def _texture(rng: np.random.Generator, base: tuple[float, float, float]) -> NDArray[np.float32]:
    """A tile (s, s, 3): noise of several wavelengths around a base colour."""
    total = np.zeros((_TEXTURE_PX, _TEXTURE_PX), dtype=np.float32)
    for cells in (8, 24, 72, 216):
        coarse = rng.standard_normal((cells, cells)).astype(np.float32)
        total += cv2.resize(coarse, total.shape, interpolation=cv2.INTER_CUBIC)
    brightness = 1.0 + _CONTRAST / 128.0 * total / total.std()
    return np.asarray(
        np.clip(brightness[..., None] * np.array(base), 20.0, 245.0), dtype=np.float32
    )
