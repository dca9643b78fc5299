"""Frames of a made-up person for starts."""

from collections.abc import Callable, Iterable

import numpy as np
import pytest

from markerless_tracker.records import Observation
from markerless_tracker.synthesis import SyntheticScene

Taken = tuple[int, dict[str, Observation], np.ndarray]


@pytest.fixture(scope="session")
def take_frames() -> Callable[[SyntheticScene, Iterable[int]], list[Taken]]:
    """Stamp, observations from exact masks, and true markers of each of a scene's frames."""

    def take(scene: SyntheticScene, indices: Iterable[int]) -> list[Taken]:
        taken = []
        for index in indices:
            _, masks, _ = scene.frame(index)
            seen = {
                name: Observation.from_mask(name, 0, mask, np.zeros(mask.shape, np.uint8))
                for name, mask in masks.items()
            }
            taken.append((scene.stamp_ns(index), seen, scene.markers(index)))
        return taken

    return take
