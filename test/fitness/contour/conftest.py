"""A body before cameras, its silhouettes' contours, and slow residuals of them."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest

from markerless_tracker.body import BodyModel, load_body
from markerless_tracker.camera import CameraModel, CameraRig
from markerless_tracker.drawing import silhouette
from markerless_tracker.fitness import Fitness
from markerless_tracker.fitness.contour.frame import SPACING_M, ContourFrame
from markerless_tracker.fitness.contour.silhouette_contour import (
    SilhouetteContour,
    silhouette_contour,
)
from markerless_tracker.geometry import FloatArray
from markerless_tracker.records import Observation
from markerless_tracker.synthesis import ring_rig

LENS = (-0.15, 0.06, 0.002, -0.0015, 0.01)
STEP_PX = 2.0
DISTANCE_M = 4.5


@dataclass(frozen=True, eq=False)
class Scene:
    """A body in front of cameras, its silhouettes at one pose, and the contours they make."""

    body: BodyModel
    rig: CameraRig
    pose: FloatArray
    observations: dict[str, Observation]
    frame: ContourFrame

    @property
    def spacing_px(self) -> float:
        return SPACING_M * self.rig.cameras[0].matrix[0, 0] / DISTANCE_M

    def edges(self, camera: CameraModel) -> SilhouetteContour:
        return silhouette_contour(self.observations[camera.name], self.spacing_px)


def scene(name, seed, make_pose, *, lens=(0.0,) * 5, cameras=4, size=(656, 490)):
    body = load_body(name, 1.75)
    rig = ring_rig(cameras, size, distance_m=DISTANCE_M, distortion=lens)
    pose = make_pose(body, np.random.default_rng(seed), spread_m=0.2)
    observations = {}
    for camera in rig:
        mask = silhouette(body, pose, camera)
        observations[camera.name] = Observation.from_mask(
            camera.name, 0, mask, np.zeros(mask.shape, np.uint8)
        )
    views = Fitness(body, rig.cameras).lay_out(observations)
    frame = ContourFrame(
        body, {c.name: c for c in rig}, observations, views,
        pixels_per_m={c.name: c.matrix[0, 0] / DISTANCE_M for c in rig},
        step_px=STEP_PX,
    )  # fmt: skip
    return Scene(body, rig, pose, observations, frame)


@pytest.fixture(scope="session")
def make_scene() -> Callable[..., Scene]:
    """`make(body_name, seed, make_pose, *, lens, cameras, size)`."""
    return scene


BODIES = ("balan31", "person31")
CASES = [(name, seed, lens) for name in BODIES for seed, lens in ((3, LENS), (4, (0.0,) * 5))]


@pytest.fixture(scope="module", params=CASES, ids=lambda c: c[0] + ("-lens" if any(c[2]) else ""))
def posed(request, make_pose) -> Scene:
    """Silhouettes of a random pose, behind a strong lens or none."""
    name, seed, lens = request.param
    made = scene(name, seed, make_pose, lens=lens)
    made.frame.collect(made.pose, 0.1)
    return made


@dataclass(frozen=True, eq=False)
class SlowResiduals:
    """Residuals of one view: values (n,), weights (n,), samples (n,), and gradients.

    Attributes:
        along: (n, 2) the residual's change by its sample's pixel.
        cost: sum of length times Tukey's cost.
    """

    value: FloatArray
    weight: FloatArray
    sample: FloatArray
    along: FloatArray
    cost: float


def tukey(r, truncation):
    return truncation**2 / 6.0 * (1.0 - max(0.0, 1.0 - (r / truncation) ** 2) ** 3)


def bilinear(edge: SilhouetteContour, point):
    """Distance at a point (2,) and its gradient (2,); None outside the window."""
    x, y = point - (edge.left, edge.top)
    height, width = edge.distance.shape
    if not (0 <= x < width - 1 and 0 <= y < height - 1):
        return None
    i, j = int(x), int(y)
    d = edge.distance[j : j + 2, i : i + 2].astype(np.float64)
    a, b = np.array([1 - (x - i), x - i]), np.array([1 - (y - j), y - j])
    return b @ d @ a, np.array([b @ d @ [-1.0, 1.0], np.array([-1.0, 1.0]) @ d @ a])


def residuals_one_by_one(made: Scene, view: int, truncation: float) -> SlowResiduals:
    """In both directions, one at a time, as documented in the kernels."""
    camera, samples = made.rig.cameras[view], made.frame.samples
    focal, n = camera.matrix[0, 0], samples.count[view]
    pixel, normal, depth, length = (
        getattr(samples, k)[view, :n] for k in ("pixel", "normal", "depth", "length")
    )
    edge = made.edges(camera)
    rows, cost = [], 0.0
    for s in range(n):
        found = bilinear(edge, pixel[s])
        kept = found is not None
        if kept:
            value, gradient = found[0] * depth[s] / focal, found[1]
            steep = np.linalg.norm(gradient)
            # Neither on ridges of the distance nor where the edge has another direction.
            kept = steep >= 0.3 and gradient @ normal[s] >= 0.5 * steep and abs(value) < truncation
        cost += length[s] * (tukey(value, truncation) if kept else truncation**2 / 6.0)
        if kept:
            weight = length[s] * (1.0 - (value / truncation) ** 2) ** 2
            rows.append((value, weight, s, gradient * depth[s] / focal))
    for at, out, px in zip(edge.points, edge.normals, edge.spacing, strict=True):
        facing = np.flatnonzero(normal @ out > 0.5)
        away = np.linalg.norm(pixel[facing] - at, axis=1)
        near = int(facing[away.argmin()]) if facing.size else 0
        far = away.min() * depth[near] / focal if facing.size else np.inf
        # An outlier has no depth of its own.
        metres = depth[near if far < truncation else 0] / focal
        cost += px * metres * tukey(min(far, truncation), truncation)
        if far < truncation:
            value = (pixel[near] - at) @ out * metres
            weight = px * metres * (1.0 - (far / truncation) ** 2) ** 2
            rows.append((value, weight, near, out * metres))
    value, weight, sample, along = map(np.array, zip(*rows, strict=True))
    return SlowResiduals(value, weight, sample, along, cost)


@pytest.fixture(scope="session")
def slow_residuals() -> Callable[..., SlowResiduals]:
    """`slow_residuals(scene, view, truncation_m)`: what the kernels should find."""
    return residuals_one_by_one


@pytest.fixture(scope="session")
def disturbed() -> Callable[..., FloatArray]:
    """`disturbed(scene, seed=0, size=0.06)`: the scene's pose, every parameter moved a little."""

    def move(made: Scene, seed: int = 0, size: float = 0.06) -> FloatArray:
        offset = size * np.random.default_rng(seed).uniform(-1, 1, made.body.size)
        return np.asarray(made.pose + offset)

    return move
