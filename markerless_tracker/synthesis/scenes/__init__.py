"""Generated scenes: a room, a person in clothes, cameras and a sensor, all sampled from one seed.

Their people are not a tracker's cones: silhouettes, starts and bodies may be measured on them.
"""

from markerless_tracker.synthesis.scenes.scene import GeneratedScene
from markerless_tracker.synthesis.scenes.spec import (
    DEVELOPMENT_SEEDS,
    TEST_SEEDS,
    PaintSpec,
    SceneSpec,
    sample_scene,
)

__all__ = [
    "DEVELOPMENT_SEEDS",
    "TEST_SEEDS",
    "GeneratedScene",
    "PaintSpec",
    "SceneSpec",
    "sample_scene",
]
