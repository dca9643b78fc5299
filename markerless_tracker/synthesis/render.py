"""Pictures of a body: shaded cones and their shadow over a room, with the exact silhouette."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.body import BodyModel
from markerless_tracker.camera import CameraModel, project_camera
from markerless_tracker.geometry import FloatArray, apply
from markerless_tracker.synthesis.kernels import compose, rasterize
from markerless_tracker.synthesis.mesh import BodyMesh, body_mesh

Image = NDArray[np.uint8]
Mask = NDArray[np.bool_]

LIGHT = np.array([0.35, -0.25, 0.90]) / np.linalg.norm([0.35, -0.25, 0.90])
"""Direction towards the lamp, world frame."""
AMBIENT = 0.60
_SKIN, _SHIRT, _TROUSERS = (130.0, 160.0, 235.0), (45.0, 50.0, 200.0), (165.0, 70.0, 30.0)
_LUMA = (0.114, 0.587, 0.299)
_CLOTHES = {
    "head": _SKIN, "neck": _SKIN, "forearm": _SKIN, "hand": _SKIN, "upper_arm": _SHIRT,
    "torso": _SHIRT, "chest": _SHIRT, "pelvis": _TROUSERS, "thigh": _TROUSERS,
    "calf": _TROUSERS, "foot": (40.0, 40.0, 45.0),
}  # fmt: skip


@dataclass(frozen=True)
class Look:
    """How pictures look.

    Attributes:
        noise: standard deviation of the sensor's noise, in grey levels.
        shadow: part of the light that the shadow on the floor takes away, 0 for none.
        samples: samples per pixel in each direction; odd: even ones bias masks outwards.
        grey: whether the camera sees brightness only.
    """

    noise: float = 3.0
    shadow: float = 0.35
    samples: int = 3
    grey: bool = False


class Renderer:
    """Renders one body in one camera.

    Args:
        body: the body.
        camera: the camera, lens included.
        background: (h, w, 3) picture of the empty room, float32, without noise.
        palette: (c, 3) BGR colour of each cone.
        look: noise, shadow, samples.
        mesh: the body's mesh, if it is already there.
    """

    def __init__(
        self,
        body: BodyModel,
        camera: CameraModel,
        background: NDArray[np.float32],
        palette: FloatArray,
        *,
        look: Look | None = None,
        mesh: BodyMesh | None = None,
    ) -> None:
        self.body = body
        self.camera = camera
        self.background = background
        self.palette = palette
        self.look = look or Look()
        self.mesh = mesh or body_mesh(body)

    def render(
        self, pose: FloatArray, rng: np.random.Generator, *, light: float = 1.0
    ) -> tuple[Image, Mask]:
        """The picture (h, w, 3) BGR or (h, w) grey at a pose (p,), and the mask (h, w) of the body.

        All brightness is multiplied by `light`, as a change of exposure does. A pixel belongs to
        the mask if the body covers at least half of it.
        """
        vertices, normals = self.mesh.posed(self.body, pose)
        shade = AMBIENT + (1.0 - AMBIENT) * np.maximum(normals @ LIGHT, 0.0)
        samples = self.look.samples
        width, height = self.camera.size_px
        size = (height * samples, width * samples)
        nearness, labels, shades = self._draw(vertices, shade, size)
        if self.look.shadow > 0.0:
            on_floor = vertices - vertices[:, 2:] / LIGHT[2] * LIGHT
            cast = self._draw(on_floor, shade, size)[0]
        else:
            cast = np.zeros_like(nearness)
        image = np.empty((height, width, 3), dtype=np.float32)
        covered = np.empty((height, width), dtype=np.float32)
        compose(
            self.background, nearness, labels, shades, self.palette, cast,
            self.look.shadow, samples, image, covered,
        )  # fmt: skip
        if light != 1.0:
            image *= np.float32(light)
        return self._noisy(image, rng), covered >= 0.5

    def empty(self, rng: np.random.Generator) -> Image:
        """A picture (h, w, 3) BGR or (h, w) grey of the empty room."""
        return self._noisy(self.background.copy(), rng)

    def _draw(
        self, vertices: FloatArray, shade: FloatArray, size: tuple[int, int]
    ) -> tuple[NDArray[np.float32], NDArray[np.int16], NDArray[np.float32]]:
        nearness = np.zeros(size, dtype=np.float32)
        labels = np.zeros(size, dtype=np.int16)
        shades = np.zeros(size, dtype=np.float32)
        pixels = project_camera(vertices, self.camera)
        depth = apply(self.camera.T_cam_world, vertices)[:, 2]
        # Pixel centres lie at integers, those of samples as well.
        points = np.column_stack([(pixels + 0.5) * self.look.samples - 0.5, 1.0 / depth])
        rasterize(points, self.mesh.triangles, self.mesh.cone, shade, nearness, labels, shades)
        return nearness, labels, shades

    def _noisy(self, image: NDArray[np.float32], rng: np.random.Generator) -> Image:
        if self.look.grey:
            image = np.asarray(image @ np.array(_LUMA, dtype=np.float32))
        if self.look.noise > 0.0:
            image += np.float32(self.look.noise) * rng.standard_normal(
                image.shape, dtype=np.float32
            )
        return np.clip(np.rint(image), 0.0, 255.0).astype(np.uint8)


def clothes(body: BodyModel, rng: np.random.Generator) -> FloatArray:
    """Colours (c, 3) BGR of a body's cones: by the part in their names, left a bit lighter."""
    palette = np.empty((len(body.cone_names), 3))
    for i, name in enumerate(body.cone_names):
        part = next((p for p in _CLOTHES if p in name), None)
        colour = rng.uniform(30.0, 220.0, 3) if part is None else np.array(_CLOTHES[part])
        side = 1.12 if name.startswith("l_") else 0.92 if name.startswith("r_") else 1.0
        palette[i] = np.clip(colour * side + rng.uniform(-12.0, 12.0, 3), 0.0, 255.0)
    return palette


def dull_clothes(body: BodyModel, rng: np.random.Generator, brightness: float) -> FloatArray:
    """Grey colours (c, 3) BGR of a body's cones whose lit surface is as bright as its background.

    Args:
        body: the body.
        rng: source of each cone's own shade, within 10 % of the background's.
        brightness: of the background, grey levels.
    """
    mean_shade = AMBIENT + 0.5 * (1.0 - AMBIENT)
    shades = brightness * rng.uniform(0.9, 1.1, (len(body.cone_names), 1)) / mean_shade
    return np.repeat(np.clip(shades, 0.0, 255.0), 3, axis=1)
