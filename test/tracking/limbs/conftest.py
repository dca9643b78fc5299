"""A watch over the limbs of a small stander, whose silhouettes are exact."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest

from markerless_tracker.body import BodyModel
from markerless_tracker.geometry import FloatArray
from markerless_tracker.records import Observation
from markerless_tracker.synthesis import SyntheticScene
from markerless_tracker.tracking import TrackerConfig
from markerless_tracker.tracking.evidence.seen import Seen
from markerless_tracker.tracking.limbs.recovered import Recovered
from markerless_tracker.tracking.limbs.watch import LimbWatch
from markerless_tracker.tracking.search import Searcher


@dataclass(frozen=True, eq=False)
class Watched:
    """The watch, the body, its true pose, and `recover` of a frame at a time."""

    watch: LimbWatch
    body: BodyModel
    pose: FloatArray
    recover: Callable[..., Recovered]


@pytest.fixture
def stander() -> Watched:
    scene = SyntheticScene(body="person31", motion="stand", size_px=(164, 123), seed=3)
    _, masks, pose = scene.frame(0)
    seen = {
        name: Observation.from_mask(name, 0, mask, np.zeros(mask.shape, np.uint8))
        for name, mask in masks.items()
    }
    body, watch = scene.body, LimbWatch(scene.rig)
    searcher = Searcher(scene.rig, body, TrackerConfig(threads=1), limits=body.limits, threads=1)
    contours = searcher.frame(seen, 0, pose).contours

    def recover(stamp_ns: int, **how: bool) -> Recovered:
        at = Seen(stamp_ns, seen, seen, seen)
        return watch.recover(searcher, contours, at, pose, **how)

    return Watched(watch, body, pose, recover)
