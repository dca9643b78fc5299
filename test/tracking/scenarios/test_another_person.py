"""Another person comes after the first one has left: the body is found anew."""

import numpy as np
import pytest

from markerless_tracker.body import BodyModel
from markerless_tracker.records import Observation, TrackState
from markerless_tracker.synthesis import SyntheticScene
from markerless_tracker.tracking import TrackerConfig, build_tracker
from markerless_tracker.tracking.person.estimate import AWAY_S

TALL_M, SHORT_M = 1.92, 1.58


def scene_of(stature_m: float) -> SyntheticScene:
    return SyntheticScene(
        body="person32", stature_m=stature_m, motion="walk", size_px=(328, 245), fps=30.0,
        cameras=4, samples=1, seed=2,
    )  # fmt: skip


def leg_m(body: BodyModel) -> float:
    return body.lengths_m["l_thigh"] + body.lengths_m["l_calf"]


@pytest.mark.parametrize(
    "away_s, fit_shape, anew",
    [(0.5 * AWAY_S, True, False), (1.5 * AWAY_S, True, True), (1.5 * AWAY_S, False, True)],
)
def test_who_comes_long_after_has_an_own_body(away_s: float, fit_shape: bool, anew: bool) -> None:
    tall, short = scene_of(TALL_M), scene_of(SHORT_M)
    config = TrackerConfig(threads=1, fit_shape=fit_shape, fit_lengths=fit_shape)
    tracker = build_tracker(tall.rig, config).tracker

    def step(scene: SyntheticScene, index: int | None, stamp_ns: int) -> TrackState:
        seen = {}
        masks = scene.frame(0 if index is None else index)[1]
        for name, mask in masks.items():
            shown = np.zeros_like(mask) if index is None else mask
            seen[name] = Observation.from_mask(name, stamp_ns, shown, np.zeros_like(mask))
        return tracker.step(seen, stamp_ns).state

    for index in range(12):
        state = step(tall, index, tall.stamp_ns(index))
    assert state is TrackState.TRACKING
    first = tracker.body
    between_m = 0.5 * (leg_m(tall.body) + leg_m(short.body))
    assert leg_m(first) > between_m
    last_ns = tall.stamp_ns(11)
    for since_ns in (50_000_000, 200_000_000, 400_000_000):
        state = step(tall, None, last_ns + since_ns)
    assert state is TrackState.SEARCHING
    begin_ns = last_ns + round(away_s * 1e9)
    for index in range(12):
        step(short, index, begin_ns + short.stamp_ns(index))
    if anew:
        assert tracker.state is TrackState.TRACKING
        assert leg_m(tracker.body) < between_m
    else:
        assert tracker.body.lengths_m == first.lengths_m
