"""Overlaps and limb measures against their thresholds."""

import pytest

from markerless_tracker.fitness import ViewTerms
from markerless_tracker.records import TrackState
from markerless_tracker.tracking.loss import (
    LIMB_LOST_BELOW,
    LIMB_REGAINED_ABOVE,
    LOST_BELOW,
    REGAINED_ABOVE,
    SCATTERED,
    LimbTrack,
    event_of,
    next_limb_state,
    shared_overlap,
    silhouette_fit,
)
from markerless_tracker.tracking.states import Event

TRACKING, LOST = TrackState.TRACKING, TrackState.LOST
MIDDLE = 0.5 * (LOST_BELOW + REGAINED_ABOVE)


def test_the_upper_threshold_lies_above_the_lower():
    assert 0.0 < LOST_BELOW < REGAINED_ABOVE < 1.0


@pytest.mark.parametrize(
    ("overlap", "expected"),
    [
        (0.0, Event.DISAGREES),
        (LOST_BELOW - 1e-9, Event.DISAGREES),
        (LOST_BELOW, Event.UNCERTAIN),
        (REGAINED_ABOVE - 1e-9, Event.UNCERTAIN),
        (REGAINED_ABOVE, Event.AGREES),
        (1.0, Event.AGREES),
        (float("nan"), Event.DISAGREES),
    ],
)
def test_events_of_overlaps(overlap, expected):
    assert event_of(overlap) is expected


def test_thresholds_rise_with_the_mean_overlap_of_the_track():
    assert event_of(0.6, 0.9) is Event.DISAGREES
    assert event_of(0.6, 0.75) is Event.UNCERTAIN
    assert event_of(0.6, 0.7) is Event.AGREES
    assert event_of(0.7, 0.9) is Event.UNCERTAIN
    assert event_of(0.8, 0.9) is Event.AGREES


def test_the_fit_is_the_mean_over_the_views():
    views = [ViewTerms(0.9, 0.0, 0.9, 3000.0), ViewTerms(0.5, 1.0, 0.2, 10.0)]
    assert silhouette_fit(views) == pytest.approx(0.7)


def test_views_count_by_what_they_show() -> None:
    well, badly = ViewTerms(0.9, 0.0, 0.9, 3000.0), ViewTerms(0.0, 0.0, 0.0, 1000.0)
    assert shared_overlap([well, badly]) == pytest.approx(0.675)
    edge, empty = ViewTerms(0.0, 0.0, 0.0, 3.0), ViewTerms(1.0, 0.0, 1.0, 0.0)
    assert shared_overlap([well, well, edge, empty]) == pytest.approx(0.9, abs=1e-3)
    assert shared_overlap([empty]) == 1.0


LIMB_MIDDLE = 0.5 * (LIMB_LOST_BELOW + LIMB_REGAINED_ABOVE)
NAN = float("nan")


@pytest.mark.parametrize(
    ("state", "inside_fraction", "particle_sd_ratio", "expected"),
    [
        (TRACKING, LIMB_LOST_BELOW - 1e-9, 0.1, LOST),
        (TRACKING, LIMB_LOST_BELOW, 0.1, TRACKING),
        (TRACKING, LIMB_MIDDLE, 0.1 * SCATTERED - 1e-9, TRACKING),
        (TRACKING, LIMB_MIDDLE, 0.1 * SCATTERED + 1e-9, LOST),
        (TRACKING, LIMB_MIDDLE, NAN, TRACKING),
        (TRACKING, LIMB_REGAINED_ABOVE, 9.0, TRACKING),
        (LOST, LIMB_MIDDLE, 0.0, LOST),
        (LOST, LIMB_REGAINED_ABOVE - 1e-9, 0.1, LOST),
        (LOST, LIMB_REGAINED_ABOVE, 0.1, TRACKING),
        (TRACKING, NAN, 0.1, TRACKING),
    ],
)
def test_a_limbs_transitions(state, inside_fraction, particle_sd_ratio, expected):
    assert next_limb_state(state, inside_fraction, particle_sd_ratio, mean_sd_ratio=0.1) is expected


def test_a_swarm_does_not_count_until_the_mean_ratio_is_known():
    assert next_limb_state(TRACKING, LIMB_MIDDLE, 9.0) is TRACKING


def test_the_mean_ratio_is_that_of_the_tracked_frames():
    limb = LimbTrack()
    assert limb.note(1.0, 0.1) is TRACKING and limb.mean_sd_ratio == pytest.approx(0.1)
    assert limb.note(1.0, NAN) is TRACKING and limb.mean_sd_ratio == pytest.approx(0.1)
    assert limb.note(0.9, 0.14) is TRACKING and limb.mean_sd_ratio == pytest.approx(0.102)
    assert limb.note(LIMB_MIDDLE, 0.2) is LOST and limb.mean_sd_ratio == pytest.approx(0.102)
    assert limb.note(LIMB_MIDDLE, 0.1) is LOST
    assert limb.note(0.9, 0.1) is TRACKING and limb.mean_sd_ratio < 0.102
