"""Silhouettes of a made-up person, and results as a tracker gives them."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from markerless_tracker.body import markers
from markerless_tracker.records import LimbState, Observation, TrackResult, TrackState
from markerless_tracker.synthesis import SyntheticScene

FPS = 10.0


@pytest.fixture(scope="session")
def scene() -> SyntheticScene:
    return SyntheticScene(body="person32", size_px=(256, 192), fps=FPS, seed=4, motion="balance")


@pytest.fixture(scope="session")
def masks(scene: SyntheticScene) -> list[dict[str, Any]]:
    """True silhouettes of ten frames by camera."""
    return [scene.frame(index)[1] for index in range(10)]


def observed(stamp_ns: int, masks: dict[str, Any]) -> dict[str, Observation]:
    """Observations of masks, without edges."""
    return {
        name: Observation.from_mask(name, stamp_ns, mask, np.zeros(mask.shape, np.uint8))
        for name, mask in masks.items()
    }


@pytest.fixture
def result(scene: SyntheticScene, masks: list[dict[str, Any]]) -> Callable[..., TrackResult]:
    """`result(index, state=, overlap=, lost=, masks=, warnings=, raised_m=)` of a frame."""

    def make(
        index: int,
        state: TrackState = TrackState.TRACKING,
        *,
        overlap: Any = 0.9,
        lost: tuple[str, ...] = (),
        warnings: tuple[str, ...] = (),
        raised_m: float = 0.0,
        shown: dict[str, Any] | None = None,
    ) -> TrackResult:
        pose = None
        if state is not TrackState.SEARCHING:
            pose = scene.pose(index)
            pose[scene.body.index("pelvis_tz")] += raised_m
        names = scene.rig.names
        by_camera = overlap if isinstance(overlap, dict) else dict.fromkeys(names, overlap)
        stamp_ns = scene.stamp_ns(index)
        return TrackResult(
            stamp_ns=stamp_ns,
            state=state,
            pose=pose,
            markers_m=None if pose is None else markers(scene.body, pose),
            fitness=1.0,
            iou={} if pose is None else by_camera,
            evaluations=0,
            observations=observed(stamp_ns, masks[index % 10] if shown is None else shown),
            warnings=warnings,
            limbs={
                name: LimbState(TrackState.LOST if name in lost else TrackState.TRACKING, 0.9, 0.5)
                for name in ("l_arm", "r_arm")
            },
        )

    return make
