"""A stander, tracked exactly."""

from collections.abc import Callable

import numpy as np
import pytest

from markerless_tracker.body import markers
from markerless_tracker.records import Observation, TrackResult, TrackState
from markerless_tracker.synthesis import SyntheticScene

FRAME_NS = 200_000_000


@pytest.fixture(scope="session")
def scene() -> SyntheticScene:
    return SyntheticScene(body="person31", motion="stand", size_px=(328, 245), seed=3)


@pytest.fixture(scope="session")
def tracked(scene) -> Callable[[int], TrackResult]:
    """Makes results, `FRAME_NS` apart, with the true pose and exact silhouettes."""

    def made(index: int) -> TrackResult:
        _, masks, pose = scene.frame(12 * index)
        seen = {
            name: Observation.from_mask(name, 0, mask, np.zeros(mask.shape, np.uint8))
            for name, mask in masks.items()
        }
        return TrackResult(
            index * FRAME_NS, TrackState.TRACKING, pose, markers(scene.body, pose), 1.8, {}, 0,
            observations=seen,
        )  # fmt: skip

    return made
