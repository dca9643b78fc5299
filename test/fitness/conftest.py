"""A slow, obvious twin of the fitness: OpenCV projects, NumPy fills and samples."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from markerless_tracker.body import BodyModel, cone_transforms, load_body
from markerless_tracker.camera import CameraModel, CameraRig
from markerless_tracker.drawing import silhouette
from markerless_tracker.fitness import Fitness
from markerless_tracker.fitness.contour import ContourFrame
from markerless_tracker.geometry import FloatArray
from markerless_tracker.records import Comparison, Observation
from markerless_tracker.synthesis import ring_rig

Mask = NDArray[np.bool_]
LENS = (-0.15, 0.06, 0.002, -0.0015, 0.01)
"""A lens with strong distortion: lines bend by some px."""


@dataclass(frozen=True)
class Edges:
    """Edge samples: their number, sum of M and of (1 - M)²."""

    count: int
    total: float
    squared: float


class Twin:
    """The silhouette and the edge samples of one body in one camera."""

    angles = np.deg2rad(np.arange(0.0, 360.0, 1.0))
    sections = np.linspace(0.0, 1.0, 9)

    def __init__(self, body: BodyModel, camera: CameraModel, pose: FloatArray) -> None:
        self.camera = camera
        self.points: list[FloatArray] = []
        self.ends: list[NDArray[np.int64]] = []
        self.depth: list[float] = []
        circle = np.stack([np.cos(self.angles), np.sin(self.angles)], axis=1)
        for place, length, shape in zip(
            cone_transforms(body, pose), body.cone_length, body.cone_shape, strict=True
        ):
            rings = []
            for t in self.sections:
                a, b, ox, oy = (1.0 - t) * shape[0] + t * shape[1]
                flat = circle * [a, b] + [ox, oy]
                rings.append(np.column_stack([flat, np.full(len(flat), t * length)]))
            world = np.concatenate(rings) @ place[:, :3].T + place[:, 3]
            local = world @ camera.T_cam_world[:3, :3].T + camera.T_cam_world[:3, 3]
            ring = np.repeat(np.arange(len(self.sections)), len(circle))
            # A cone that extends behind the camera is not drawn.
            seen = bool(local[:, 2].min() > 0.15)
            self.points.append(self.project(world) if seen else np.empty((0, 2)))
            self.ends.append(ring)
            self.depth.append(float(local[:, 2].mean()))

    def project(self, world: FloatArray) -> FloatArray:
        rotation, _ = cv2.Rodrigues(self.camera.T_cam_world[:3, :3])
        pixels, _ = cv2.projectPoints(
            world, rotation, self.camera.T_cam_world[:3, 3], self.camera.matrix,
            self.camera.distortion,
        )  # fmt: skip
        return np.asarray(pixels, dtype=np.float64).reshape(-1, 2)

    def cone(self, index: int, samples: int = 1) -> Mask:
        """Pixels (h, w) of a cone's hull, or of `samples` times as fine a grid."""
        width, height = self.camera.size_px
        inside = np.zeros((height * samples, width * samples), dtype=np.bool_)
        points = self.points[index]
        if len(points) == 0:
            return inside
        hull = cv2.convexHull(points.astype(np.float32))[:, 0].astype(np.float64)
        # Sample i of a pixel lies at (i + ½) / samples - ½ from its centre.
        u = (np.arange(width * samples) + 0.5) / samples - 0.5
        v = (np.arange(height * samples) + 0.5) / samples - 0.5
        columns = np.flatnonzero((u >= hull[:, 0].min()) & (u <= hull[:, 0].max()))
        rows = np.flatnonzero((v >= hull[:, 1].min()) & (v <= hull[:, 1].max()))
        if columns.size == 0 or rows.size == 0:
            return inside
        u, v = u[columns], v[rows, None]
        within = np.ones((rows.size, columns.size), dtype=np.bool_)
        following = np.roll(hull, -1, axis=0)
        turn = np.sign(np.sum(hull[:, 0] * following[:, 1] - hull[:, 1] * following[:, 0]))
        for (pu, pv), (qu, qv) in zip(hull, following, strict=True):
            # The sign of the cross product, by row and by column.
            within &= turn * ((qu - pu) * (v - pv)) >= turn * ((qv - pv) * (u - pu))
        inside[np.ix_(rows, columns)] = within
        return inside

    def silhouette(self, cones: Mask | None = None, samples: int = 1) -> Mask:
        """Union of the cones' pixels."""
        chosen = range(len(self.points)) if cones is None else np.flatnonzero(cones)
        return np.any([self.cone(int(c), samples) for c in chosen], axis=0)

    def perimeter(self) -> float:
        """Length of all cones' outlines, px; those outside the frame included."""
        return sum(
            cv2.arcLength(cv2.convexHull(p.astype(np.float32)), True) for p in self.points if len(p)
        )

    def tangents(self, index: int) -> list[tuple[FloatArray, FloatArray]]:
        """The two sides of a cone, each from end 0 to end 1; none if seen end-on."""
        points, ring = self.points[index], self.ends[index]
        if len(points) == 0:
            return []
        only_ends = (ring == 0) | (ring == ring.max())
        points, ring = points[only_ends], ring[only_ends]
        hull = cv2.convexHull(points.astype(np.float32), returnPoints=False).ravel()
        sides = []
        for i, j in zip(hull, np.roll(hull, -1), strict=True):
            if ring[i] != ring[j]:
                first, second = (i, j) if ring[i] == 0 else (j, i)
                sides.append((points[first], points[second]))
        return sides

    def edges(
        self,
        strength: NDArray[np.uint8],
        rule: str,
        edges: Mask,
        cones: Mask,
        *,
        spacing_px: float,
        step_px: float,
    ) -> Edges:
        """Sample an edge map (h, w) as a rule says.

        Args:
            edges: (c, 2) whether sides and far edge of each cone are sampled.
            cones: (c,) cones that are drawn, hence hide.
        """
        width, height = self.camera.size_px
        drawn = [self.cone(c) & cones[c] for c in range(len(self.points))]
        values = []
        for c in range(len(self.points)):
            sides = self.tangents(c)
            if len(sides) != 2:
                continue
            middle = 0.25 * (sides[0][0] + sides[0][1] + sides[1][0] + sides[1][1])
            lines = [(*side, middle) for side in sides] if edges[c, 0] else []
            if edges[c, 1]:
                lines.append((sides[0][1], sides[1][1], middle))
            if rule == "visible":
                nearer = [drawn[o] for o in range(len(drawn)) if self.depth[o] < self.depth[c]]
                hidden = np.any(nearer, axis=0) if nearer else np.zeros((height, width), bool)
            else:
                hidden = np.any(drawn, axis=0)
            for p, q, inner in lines:
                length = float(np.linalg.norm(q - p))
                normal = np.array([-(q - p)[1], (q - p)[0]]) / length
                normal *= -np.sign(normal @ (inner - p))
                count = max(4, int(length / spacing_px))
                for t in (np.arange(count) + 0.5) / count:
                    at = np.rint(p + t * (q - p)).astype(int)
                    if not (0 <= at[0] < width and 0 <= at[1] < height):
                        continue
                    look = at if rule == "visible" else np.rint(p + t * (q - p) + step_px * normal)
                    u, v = np.asarray(look).astype(int)
                    inside = 0 <= u < width and 0 <= v < height
                    if rule != "sides" and inside and hidden[v, u]:
                        continue
                    values.append(strength[at[1], at[0]] / 255.0)
        m = np.array(values)
        return Edges(m.size, float(m.sum()), float(((1.0 - m) ** 2).sum()))


@pytest.fixture(scope="session")
def twin() -> type[Twin]:
    return Twin


def random_pose(body: BodyModel, rng: np.random.Generator, *, spread_m: float) -> FloatArray:
    """A pose anywhere inside the limits' middle half, in any direction, near the rig's target."""
    held = np.flatnonzero(np.isfinite(body.limits).all(axis=0))
    low, high = body.limits[:, held]
    pose = np.zeros(body.size)
    pose[held] = 0.5 * (low + high) + 0.25 * (high - low) * rng.uniform(-1.0, 1.0, held.size)
    named = {name: body.index(f"pelvis_{name}") for name in ("rx", "ry", "rz", "tx", "ty", "tz")}
    pose[[named["rx"], named["ry"]]] = rng.uniform(-0.4, 0.4, 2)
    pose[named["rz"]] = rng.uniform(-np.pi, np.pi)
    pose[[named["tx"], named["ty"]]] = spread_m * rng.uniform(-1.0, 1.0, 2)
    pose[named["tz"]] = 0.95 + rng.uniform(-0.1, 0.1)
    return pose


@pytest.fixture(scope="session")
def make_pose() -> Callable[..., FloatArray]:
    return random_pose


@pytest.fixture(scope="session")
def body() -> BodyModel:
    """The published body, of ten round cones but for the torso and the head."""
    return load_body("balan31", 1.75)


@pytest.fixture(scope="session")
def person() -> BodyModel:
    """The shipped body of elliptic cones."""
    return load_body("person31", 1.75)


@pytest.fixture(scope="session")
def elliptic_body(body: BodyModel) -> BodyModel:
    """The same bones in flat cones, each off its axis differently at both ends."""
    rng = np.random.default_rng(11)
    shape = body.cone_shape.copy()
    shape[:, :, :2] *= rng.uniform(0.6, 1.5, shape[:, :, :2].shape)
    shape[:, :, 2:] = rng.uniform(-0.05, 0.05, shape[:, :, 2:].shape)
    return replace(body, name="elliptic", cone_shape=shape)


@pytest.fixture(scope="session")
def rig() -> CameraRig:
    """Four cameras without distortion, 320x240 px."""
    return ring_rig(4, (320, 240), distortion=(0.0,) * 5)


@pytest.fixture(scope="session")
def lens_rig() -> CameraRig:
    """Four cameras behind a strong lens."""
    return ring_rig(4, (320, 240), distortion=LENS)


@pytest.fixture(scope="session")
def make_observation() -> Callable[..., Observation]:
    """`make(camera, mask, edges=None, stamp_ns=0)`: an observation of the full frame."""

    def make(
        camera: CameraModel,
        mask: Mask,
        edges: NDArray[np.uint8] | None = None,
        stamp_ns: int = 0,
    ) -> Observation:
        strength = np.zeros(mask.shape, np.uint8) if edges is None else edges
        return Observation.from_mask(camera.name, stamp_ns, mask, strength)

    return make


@pytest.fixture(scope="session")
def smooth_edges() -> Callable[..., NDArray[np.uint8]]:
    """`make(camera, seed)`: an edge map that changes over some ten px."""

    def make(camera: CameraModel, seed: int) -> NDArray[np.uint8]:
        width, height = camera.size_px
        noise = np.random.default_rng(seed).standard_normal((height, width))
        field = cv2.GaussianBlur(noise, (0, 0), 6.0)
        field = (field - field.min()) / (field.max() - field.min())
        return np.asarray(np.rint(255.0 * field), dtype=np.uint8)

    return make


@pytest.fixture(scope="session")
def contours_of() -> Callable[..., ContourFrame]:
    """``contours_of(person, pose, rig, body)``: a person's silhouettes, as evidence for a body."""

    def make(person: BodyModel, pose: FloatArray, rig: CameraRig, body: BodyModel) -> ContourFrame:
        observations = {}
        for camera in rig:
            mask = silhouette(person, pose, camera).astype(np.uint8)
            observations[camera.name] = Observation.from_mask(
                camera.name, 0, mask, np.zeros(mask.shape, np.uint8)
            )
        return ContourFrame(
            body,
            {camera.name: camera for camera in rig},
            observations,
            Fitness(body, rig.cameras).lay_out(observations),
            pixels_per_m={camera.name: camera.matrix[0, 0] / 4.5 for camera in rig},
        )

    return make


@pytest.fixture
def pose(body: BodyModel) -> FloatArray:
    """Standing upright."""
    standing = body.neutral.copy()
    standing[body.index("pelvis_tz")] = 0.95
    return standing


@pytest.fixture
def observations(
    twin: type[Twin],
    smooth_edges: Callable[..., NDArray[np.uint8]],
    make_observation: Callable[..., Observation],
    body: BodyModel,
    rig: CameraRig,
    pose: FloatArray,
) -> dict[str, Observation]:
    """Silhouettes of a body 50 mm beside `pose`, and smooth edge maps."""
    moved = pose.copy()
    moved[body.index("pelvis_tx")] += 0.05
    return {
        c.name: make_observation(c, twin(body, c, moved).silhouette(), smooth_edges(c, i))
        for i, c in enumerate(rig)
    }


@pytest.fixture(scope="session")
def make_comparison() -> Callable[..., Comparison]:
    """`make_comparison(body, centre, **changes)`: compares everything."""

    def make(body: BodyModel, centre: FloatArray, **changes: object) -> Comparison:
        default = Comparison.whole(centre, len(body.cone_names), edge_weight=1.0)
        return replace(default, **changes)  # type: ignore[arg-type]

    return make
