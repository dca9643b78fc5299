"""A made-up person in four small views, and trackers whose settings are all named."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from markerless_tracker.body import BodyModel, load_body
from markerless_tracker.camera import CameraModel, CameraRig
from markerless_tracker.fitness.raster.silhouette import body_masks
from markerless_tracker.geometry import FloatArray
from markerless_tracker.imaging import Image, learn_background
from markerless_tracker.records import Observation
from markerless_tracker.synthesis import SyntheticScene, ring_rig
from markerless_tracker.tracking import Tracker, TrackerConfig

SWARM: Mapping[str, Any] = {
    "body": "balan31",
    "optimizer": "sppso",
    "evaluations": 1000,
    "refinement": "none",
    "fit_shape": False,
    "prediction": 0.0,
    "sigma.scale": 0.5,
    "sigma.rate_max": 6.0,
    "edge_weight": 0.5,
    "edges.rule": "outline",
    "edges.term": "ssd",
    "sppso.update": "iteration",
    "limits": "anatomical",
    "collision": "elliptic",
    "seed": 0,
    "threads": 1,
}
"""Every setting of the search, so that no default matters; a swarm alone."""
REFINED: Mapping[str, Any] = {
    **SWARM,
    "refinement": "contour",
    "refine.iterations": 3,
    "fit_shape": True,
    "prediction": 0.6,
}
"""The same with contour refinement and a fitted shape."""


@dataclass(frozen=True)
class Frame:
    """One moment of the scene, with the truth."""

    stamp_ns: int
    images: Mapping[str, Image]
    masks: Mapping[str, Any]
    pose: FloatArray
    markers_m: FloatArray

    @property
    def observations(self) -> dict[str, Observation]:
        """The exact silhouettes, without edges."""
        return {
            name: Observation.from_mask(name, self.stamp_ns, mask, np.zeros(mask.shape, np.uint8))
            for name, mask in self.masks.items()
        }


@pytest.fixture(scope="session")
def scene() -> SyntheticScene:
    return SyntheticScene(body="balan31", motion="walk", size_px=(256, 192), seed=4, noise=2.0)


@pytest.fixture(scope="session")
def frames(scene) -> list[Frame]:
    taken = []
    for index in range(5):
        images, masks, pose = scene.frame(index)
        taken.append(Frame(scene.stamp_ns(index), images, masks, pose, scene.markers(index)))
    return taken


@pytest.fixture(scope="session")
def backgrounds(scene):
    config = TrackerConfig.from_mapping(SWARM)
    return {name: learn_background(f, config) for name, f in scene.backgrounds(6).items()}


@pytest.fixture(scope="session")
def swarm_settings() -> dict[str, Any]:
    return dict(SWARM)


@pytest.fixture(scope="session")
def refined_settings() -> dict[str, Any]:
    return dict(REFINED)


@pytest.fixture
def make_tracker(scene, backgrounds) -> Callable[..., Tracker]:
    """`make(settings=SWARM, start_pose=truth, rig=true, **changes)`: starts at the truth."""

    def make(
        settings: Mapping[str, Any] = SWARM,
        start_pose: FloatArray | None = None,
        rig: CameraRig | None = None,
        **changes: Any,
    ) -> Tracker:
        return Tracker(
            scene.rig if rig is None else rig,
            scene.body,
            TrackerConfig.from_mapping({**settings, **changes}),
            start_pose=scene.pose(0) if start_pose is None else start_pose,
            backgrounds=backgrounds,
        )

    return make


@pytest.fixture(scope="module")
def body() -> BodyModel:
    return load_body("balan31", 1.75)


@pytest.fixture(scope="module")
def camera() -> CameraModel:
    return ring_rig(1, (240, 180)).cameras[0]


@pytest.fixture
def pose(body) -> FloatArray:
    """Standing on the floor."""
    standing = body.neutral.copy()
    standing[body.index("pelvis_tz")] = 0.95
    return standing


BentLeg = tuple[
    SyntheticScene, dict[str, Image], FloatArray, FloatArray, Mapping[str, NDArray[np.bool_]]
]


@pytest.fixture(scope="session")
def bent_leg() -> Callable[[float, float], BentLeg]:
    """Makes a stander, and a pose whose left leg is bent by angles of the hip and the knee in rad.

    Gives the scene, the masks, both poses (p,), and what the body covers at the wrong one.
    """

    def make(hip_rad: float, knee_rad: float) -> BentLeg:
        scene = SyntheticScene(body="person31", motion="stand", size_px=(328, 245), seed=3)
        _, masks, pose = scene.frame(0)
        wrong = pose.copy()
        wrong[[scene.body.index("l_hip_y"), scene.body.index("l_knee")]] += hip_rad, knee_rad
        return scene, masks, pose, wrong, body_masks(scene.body, wrong, list(scene.rig))

    return make
