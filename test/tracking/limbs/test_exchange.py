"""Legs that were tracked into each other's place are exchanged."""

import numpy as np
import pytest

from markerless_tracker.body import MARKER_NAMES, markers
from markerless_tracker.records import Observation
from markerless_tracker.synthesis import SyntheticScene
from markerless_tracker.tracking import TrackerConfig
from markerless_tracker.tracking.evidence.seen import Seen
from markerless_tracker.tracking.limbs.exchange import EVERY_NS, LEAST_M, LegExchange
from markerless_tracker.tracking.limbs.watch import LimbWatch
from markerless_tracker.tracking.search import Searcher
from markerless_tracker.tracking.start.mirror import Mirror

ANKLES = [MARKER_NAMES.index(name) for name in ("LAnkle", "RAnkle")]


@pytest.fixture(scope="module")
def walking():
    """A step, its silhouettes, the true pose and that with the legs in each other's place."""
    scene = SyntheticScene(body="person31", motion="walk", size_px=(328, 245), seed=3)
    best, apart = 0, 0.0
    for frame in range(0, 40, 4):
        at = markers(scene.body, scene.frame(frame)[2])[ANKLES]
        if (gap := float(np.linalg.norm(at[0] - at[1]))) > apart:
            best, apart = frame, gap
    _, masks, pose = scene.frame(best)
    seen = {
        name: Observation.from_mask(name, 0, mask, np.zeros(mask.shape, np.uint8))
        for name, mask in masks.items()
    }
    swapped, legs = pose.copy(), scene.body.subspaces["legs"]
    swapped[legs] = Mirror(scene.body).of(pose)[legs]
    return scene, seen, pose, swapped


def off_m(body, pose, true):
    return np.linalg.norm(markers(body, pose) - markers(body, true), axis=1)[ANKLES].max()


def recovered(scene, seen, pose, stamp_ns=0):
    body, config = scene.body, TrackerConfig(threads=1)
    searcher = Searcher(scene.rig, body, config, limits=body.limits, threads=1)
    contours = searcher.frame(seen, stamp_ns, pose).contours
    return LimbWatch(scene.rig).recover(searcher, contours, Seen(stamp_ns, seen, seen, seen), pose)


def test_exchanged_legs_are_exchanged_back(walking) -> None:
    scene, seen, true, swapped = walking
    assert off_m(scene.body, swapped, true) > 0.3
    found = recovered(scene, seen, swapped)
    assert found.names[:1] == ("legs",)
    assert found.notes[0] == "legs: found elsewhere"
    assert set(scene.body.subspaces["legs"]) <= set(found.jumped(scene.body))
    assert off_m(scene.body, found.pose, true) < 0.05


def test_legs_in_their_place_stay(walking) -> None:
    scene, seen, true, _ = walking
    assert "legs" not in recovered(scene, seen, true).names


def test_it_is_tried_at_intervals_and_where_it_changes_anything(walking) -> None:
    scene, _, true, swapped = walking
    body, exchange = scene.body, LegExchange()
    first = exchange.due(body, true, body.limits, 10)
    assert first is not None
    np.testing.assert_allclose(markers(body, first), markers(body, swapped), atol=0.01)
    assert exchange.due(body, true, body.limits, 10 + EVERY_NS - 1) is None
    assert exchange.due(body, true, body.limits, 10 + EVERY_NS) is not None
    # Time that was set back begins anew.
    assert exchange.due(body, true, body.limits, 0) is not None
    exchange.reset()
    assert exchange.due(body, body.neutral, body.limits, 0) is None
    assert LEAST_M > 0.0
