"""The body of an unknown person, fitted while it is tracked."""

import numpy as np
import pytest

from markerless_tracker.body import load_description
from markerless_tracker.body.sizes import Sizes
from markerless_tracker.records import Observation
from markerless_tracker.synthesis import SyntheticScene
from markerless_tracker.tracking import TrackerConfig, build_tracker
from markerless_tracker.tracking.person.body_fitting import EVERY, FRAMES
from markerless_tracker.tracking.person.estimate import (
    RECOVERED_FRAMES,
    BodyEstimate,
)
from markerless_tracker.tracking.search import Searcher
from markerless_tracker.tracking.start.two_headings import SETTLING_FRAMES

SIZES = Sizes(load_description("person31"))
TAKEN = EVERY * FRAMES + 8
"""Frames of a fit: after those in which others are taken, 6 pieces are left of the step in progress
and 30 of the last steps, 5 in a frame; then the last piece is complete."""
LAST = SETTLING_FRAMES + TAKEN - 1
"""The step, from 0, that ends with the fitted body."""
START = SETTLING_FRAMES - 1
"""The step in which the start fits the body for the first time."""


@pytest.fixture(scope="module")
def walk():
    """Observations of a walking person, as many as three fits need."""
    scene = SyntheticScene(body="person31", motion="walk", size_px=(164, 123), seed=2)
    taken = []
    for index in range(LAST + 2 * TAKEN + 1):
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


def test_lengths_change_after_the_start_and_once_more_and_are_kept(walk) -> None:
    """Without a limb found elsewhere: nothing is searched again."""
    scene, taken = walk
    config = TrackerConfig(threads=1, search_again=False)
    tracker = build_tracker(scene.rig, config, stature=1.65).tracker
    lengths = tracked(tracker, taken[: LAST + 6])
    assert changes(lengths) == [START, LAST]
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
    assert changes(tracked(tracker, taken[: LAST + 6])) == []


@pytest.mark.parametrize(
    ("recovered", "most", "fits"),
    [
        pytest.param(range(SETTLING_FRAMES + 1, SETTLING_FRAMES + 2), 6, 2, id="once"),
        pytest.param(range(LAST + 2 * TAKEN + 1), 6, 3, id="always"),
        pytest.param(range(LAST + 2 * TAKEN + 1), 1, 2, id="at most one more"),
    ],
)
def test_lengths_are_fitted_again_when_a_limb_was_found_elsewhere(
    walk, monkeypatch, recovered: range, most: int, fits: int
) -> None:
    """A fit in progress is completed before the next one begins."""
    scene, taken = walk
    config = TrackerConfig(threads=1, search_again=False)
    tracker = build_tracker(scene.rig, config, stature=1.65).tracker
    fit = BodyEstimate.fit_tracked_frame
    stamps = [taken[index][0] for index in recovered]

    def with_recovery(self, search, *, rotated: bool, recovered: bool):
        return fit(self, search, rotated=rotated, recovered=now in stamps)

    monkeypatch.setattr(BodyEstimate, "fit_tracked_frame", with_recovery)
    monkeypatch.setattr("markerless_tracker.tracking.person.estimate.MOST_RECOVERED", most)
    lengths = []
    for now, seen in taken:
        tracker.step(seen, now)
        lengths.append(SIZES.of(tracker.body))
    assert changes(np.array(lengths)) == [START, *(LAST + TAKEN * k for k in range(fits))]


@pytest.mark.parametrize(
    ("since", "anew"), [(RECOVERED_FRAMES, True), (RECOVERED_FRAMES + 1, False)]
)
def test_a_fit_is_doubtful_for_a_while_when_a_limb_is_found_elsewhere(
    walk, since: int, anew: bool
) -> None:
    scene, taken = walk
    config = TrackerConfig(threads=1, search_again=False)
    tracker = build_tracker(scene.rig, config, stature=1.65).tracker
    lengths = tracked(tracker, taken[: LAST + 6])
    stamp, seen = taken[LAST + 5]
    search = Searcher(
        scene.rig, tracker.body, tracker.config, limits=tracker.body.limits, threads=1
    ).frame(seen, stamp, tracker.step(seen, stamp + 1).pose)
    estimate = tracker._body
    estimate._since_fit = since - 1
    for index in range(TAKEN):
        estimate.fit_tracked_frame(search, recovered=index == 0)
    assert (SIZES.of(estimate.body) != lengths[-1]).any() == anew
