"""One camera's images of a generated room and of what stands in it."""

import cv2
import numpy as np
from numpy.typing import NDArray

from markerless_tracker.body.model import IntArray
from markerless_tracker.camera import CameraModel, project_camera
from markerless_tracker.geometry import FloatArray, apply
from markerless_tracker.synthesis.rig import look_at
from markerless_tracker.synthesis.rooms.kernels import cover, look, nearest_triangles, shine
from markerless_tracker.synthesis.rooms.lighting import Lighting, Triangles
from markerless_tracker.synthesis.rooms.spec import CameraSpec, SensorSpec
from markerless_tracker.synthesis.rooms.surfaces import HALF_M, RISE, SIZE, TEXEL_M

Image = NDArray[np.uint8]
Mask = NDArray[np.bool_]

SAMPLES = 3
"""Samples per pixel in each direction; odd: even ones bias masks outwards."""
_PAINT_SAMPLES = 2
_LUMA = np.array([0.114, 0.587, 0.299], dtype=np.float32)
_LEAST_BLUR_PX = 0.3


def camera_model(name: str, spec: CameraSpec, size_px: tuple[int, int]) -> CameraModel:
    """The calibrated camera of a spec."""
    matrix = np.array(
        [
            [spec.focal_px, 0.0, 0.5 * (size_px[0] - 1)],
            [0.0, spec.focal_px, 0.5 * (size_px[1] - 1)],
            [0.0, 0.0, 1.0],
        ]
    )
    pose = look_at(np.array(spec.eye_m), np.array(spec.target_m))
    return CameraModel(name, size_px, matrix, np.array(spec.distortion), pose)


class View:
    """A camera in a room.

    Args:
        camera: the calibrated camera.
        spec: its gains, blur and vignette.
        sensor: colour cast, tone curve, noise.
        lighting: the room's lamps.
        sheet: paint of the room's surfaces.
    """

    def __init__(
        self,
        camera: CameraModel,
        spec: CameraSpec,
        sensor: SensorSpec,
        lighting: Lighting,
        sheet: NDArray[np.float32],
    ) -> None:
        self.camera = camera
        self._spec, self._sensor = spec, sensor
        self._texels, points, seen = _seen(camera, lighting, 1)
        normals = np.array([p.normal for p in lighting.planes])[seen]
        fine, _, nothing = _seen(camera, lighting, _PAINT_SAMPLES)
        paint = _sampled(sheet, fine)
        paint[nothing < 0] = 12.0
        width, height = camera.size_px
        self._paint = np.asarray(
            cv2.resize(paint, (width, height), interpolation=cv2.INTER_AREA), dtype=np.float32
        )
        normals = normals.reshape(-1, 3)
        arriving = lighting.arriving(points.reshape(-1, 3), normals)
        self._ambient = lighting.ambient(normals).reshape(height, width, 3).astype(np.float32)
        self._lamps = arriving.reshape(-1, height, width, 3).astype(np.float32)
        v, u = np.indices((height, width))
        off = np.hypot(u - 0.5 * width, v - 0.5 * height) / np.hypot(0.5 * width, 0.5 * height)
        gains = np.array(sensor.cast) * np.array(spec.gains)
        self._gain = np.asarray((1.0 - spec.vignette * off**2)[..., None] * gains, dtype=np.float32)

    def level(self) -> float:
        """Mean of the empty room's image before exposure."""
        light = self._lamps.sum(axis=0) + self._ambient
        return float((self._paint * light * self._gain).mean())

    def light_on(
        self,
        hidden: NDArray[np.float32],
        solid: Triangles,
        colours: FloatArray,
        person: Mask,
    ) -> tuple[NDArray[np.float32], Mask]:
        """The light (h, w, 3) that arrives at the lens, and the exact mask (h, w) of the person.

        Args:
            hidden: as `Lighting.hidden` gives it.
            solid: what stands in the room.
            colours: (k, 3) of its vertices, light included.
            person: (m,) whether a triangle is the person's.
        """
        width, height = self.camera.size_px
        on_pixels = np.stack([_sampled(part, self._texels) for part in hidden])
        picture = np.empty((height, width, 3), dtype=np.float32)
        shine(self._paint, self._ambient, self._lamps, on_pixels, picture)
        covered = np.zeros((height, width), dtype=np.float32)
        self._draw(picture, solid, colours, person, covered)
        picture *= self._gain
        return picture, covered >= 0.5

    def visible(self, solid: Triangles) -> IntArray:
        """Triangles seen at the pixels that show any, as many times as they are seen."""
        width, height = self.camera.size_px
        points = project_camera(solid.vertices, self.camera)
        depth = apply(self.camera.T_cam_world, solid.vertices)[:, 2]
        nearness = np.zeros((height, width), dtype=np.float32)
        number = np.full((height, width), -1, dtype=np.int32)
        nearest_triangles(np.column_stack([points, 1.0 / depth]), solid.triangles, nearness, number)
        return np.asarray(number[number >= 0], dtype=np.int64)

    def _draw(
        self, picture: NDArray[np.float32], solid: Triangles, colours: FloatArray, person: Mask,
        covered: NDArray[np.float32],
    ) -> None:  # fmt: skip
        width, height = self.camera.size_px
        pixels = project_camera(solid.vertices, self.camera)
        depth = apply(self.camera.T_cam_world, solid.vertices)[:, 2]
        known = pixels[np.isfinite(pixels).all(axis=1)]
        if not len(known):
            return
        low = np.clip(np.floor(known.min(axis=0)).astype(int) - 1, 0, [width, height])
        high = np.clip(np.ceil(known.max(axis=0)).astype(int) + 2, 0, [width, height])
        if (high <= low).any():
            return
        size = ((high - low) * SAMPLES)[::-1]
        points = np.column_stack([(pixels - low + 0.5) * SAMPLES - 0.5, 1.0 / depth])
        nearness = np.zeros(size, dtype=np.float32)
        number = np.full(size, -1, dtype=np.int32)
        nearest_triangles(points, solid.triangles, nearness, number)
        cover(
            picture, int(low[0]), int(low[1]), points, solid.triangles, number, colours, person,
            SAMPLES, covered,
        )  # fmt: skip

    def taken(
        self, picture: NDArray[np.float32], rng: np.random.Generator, exposure: float
    ) -> Image:
        """What the sensor makes of the light (h, w, 3): the image (h, w, 3) BGR or (h, w) grey."""
        sensor = self._sensor
        picture = picture * np.float32(exposure)
        if self._spec.blur_px >= _LEAST_BLUR_PX:
            picture = np.asarray(
                cv2.GaussianBlur(picture, (0, 0), self._spec.blur_px), dtype=np.float32
            )
        if sensor.grey:
            picture = picture @ _LUMA
        np.clip(picture, 0.0, 255.0, out=picture)
        tone = cv2.pow(picture * np.float32(1.0 / 255.0), sensor.gamma)
        picture = np.asarray(tone, dtype=np.float32) * np.float32(255.0)
        # Half of the variance is the light's own: it grows with the level.
        noise = rng.standard_normal(picture.shape, dtype=np.float32)
        noise *= np.float32(sensor.noise) * np.sqrt(0.5 + picture * np.float32(1.0 / 256.0))
        return np.asarray(np.clip(np.rint(picture + noise), 0.0, 255.0), dtype=np.uint8)


def _sampled(sheet: NDArray[np.float32], texels: NDArray[np.float32]) -> NDArray[np.float32]:
    """Values of the sheet (rows, columns, ...) at texels (h, w, 2)."""
    u, v = np.ascontiguousarray(texels[..., 0]), np.ascontiguousarray(texels[..., 1])
    return np.asarray(
        cv2.remap(sheet, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE), dtype=np.float32
    )


def _seen(
    camera: CameraModel, lighting: Lighting, samples: int
) -> tuple[NDArray[np.float32], FloatArray, IntArray]:
    """What each of samples x samples points of every pixel shows of the room.

    Returns (h, w, 2) places on the sheet, (h, w, 3) points in m and (h, w) the plane, -1 for none;
    h and w count samples.
    """
    width, height = (n * samples for n in camera.size_px)
    u, v = np.meshgrid(
        (np.arange(width) + 0.5) / samples - 0.5, (np.arange(height) + 0.5) / samples - 0.5
    )
    flat = cv2.undistortPoints(
        np.stack([u.ravel(), v.ravel()], axis=1)[:, None], camera.matrix, camera.distortion
    )[:, 0]
    texels = np.empty((flat.shape[0], 2), dtype=np.float32)
    points = np.zeros((flat.shape[0], 3))
    seen = np.empty(flat.shape[0], dtype=np.int64)
    planes = np.array([[p.axis, p.level_m, p.inward, p.row] for p in lighting.planes])
    pose = camera.T_world_cam
    look(
        np.ascontiguousarray(flat), np.ascontiguousarray(pose[:3, :3]), pose[:3, 3].copy(), planes,
        np.array([HALF_M, TEXEL_M, SIZE, RISE]), texels, points, seen,
    )  # fmt: skip
    return (
        texels.reshape(height, width, 2),
        points.reshape(height, width, 3),
        seen.reshape(height, width),
    )
