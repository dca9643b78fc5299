"""The body of an unknown person, fitted while it is tracked."""

import numpy as np
import pytest

from markerless_tracker.body import load_description
from markerless_tracker.body.sizes import Sizes
from markerless_tracker.records import Observation
from markerless_tracker.synthesis import SyntheticScene
from markerless_tracker.tracking import TrackerConfig, build_tracker
from markerless_tracker.tracking.person.body_fitting import EVERY, FRAMES, POLISH
from markerless_tracker.tracking.start.starter import SETTLING_FRAMES

SIZES = Sizes(load_description("person31"))
TAKEN = EVERY * FRAMES + POLISH
LAST = SETTLING_FRAMES + TAKEN - 1
"""The step, from 0, that ends with the fitted body."""


@pytest.fixture(scope="module")
def walk():
    """Observations of a walking person, as many as a fit needs and some more."""
    scene = SyntheticScene(body="person31", motion="walk", size_px=(164, 123), seed=2)
    taken = []
    for index in range(LAST + 3):
        _, masks, _ = scene.frame(index)
        seen = {
            name: Observation.from_mask(name, 0, mask, np.zeros(mask.shape, np.uint8))
            for name, mask in masks.items()
        }
        taken.append((scene.stamp_ns(index), seen))
    return scene, taken


def tracked(tracker, taken):
    """The lengths after each step."""
    out = []
    for stamp, seen in taken:
        tracker.step(seen, stamp)
        out.append(SIZES.of(tracker.body))
    return np.array(out)


def changes(lengths):
    """The steps whose lengths differ from those before."""
    return (np.flatnonzero(np.abs(np.diff(lengths, axis=0)).max(axis=1) > 0) + 1).tolist()


def test_lengths_change_once_and_are_kept(walk) -> None:
    scene, taken = walk
    tracker = build_tracker(scene.rig, TrackerConfig(threads=1), stature=1.65).tracker
    lengths = tracked(tracker, taken)
    assert changes(lengths) == [LAST]
    true = SIZES.of(scene.body)
    before, after = np.abs(np.log(lengths[[0, -1]] / true)).mean(axis=1)
    assert after < before
    # After a reset it begins as it began before, to the bit.
    tracker.reset()
    again = tracked(tracker, taken[:SETTLING_FRAMES])
    np.testing.assert_array_equal(again, lengths[:SETTLING_FRAMES])


@pytest.mark.parametrize(
    ("settings", "subject"),
    [({"fit_lengths": False}, {"stature": 1.65}), ({"fit_shape": False}, {"stature": 1.65})],
)
def test_lengths_can_be_left_alone(walk, settings, subject) -> None:
    scene, taken = walk
    tracker = build_tracker(scene.rig, TrackerConfig(threads=1, **settings), **subject).tracker
    assert changes(tracked(tracker, taken)) == []
