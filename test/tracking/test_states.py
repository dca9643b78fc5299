"""Transitions between the phases of a track, without images."""

from itertools import product

import pytest
from hypothesis import given
from hypothesis import strategies as st

from markerless_tracker.records import TrackState
from markerless_tracker.tracking.loss import LOST_BELOW, REGAINED_ABOVE, event_of
from markerless_tracker.tracking.states import PATIENCE_NS, TRANSITIONS, Event, Phase, Track

MIDDLE = 0.5 * (LOST_BELOW + REGAINED_ABOVE)
FRAME_EVENTS = tuple(event for event in Event if event is not Event.GIVEN_UP)
EXPECTED = """
SEARCHING NO_PERSON SEARCHING
SEARCHING FOUND     SETTLING
SEARCHING DISAGREES LOST
SEARCHING UNCERTAIN TRACKING
SEARCHING AGREES    TRACKING
SETTLING  NO_PERSON SEARCHING
SETTLING  FOUND     SETTLING
SETTLING  DISAGREES LOST
SETTLING  UNCERTAIN TRACKING
SETTLING  AGREES    TRACKING
TRACKING  NO_PERSON LOST
TRACKING  DISAGREES LOST
TRACKING  UNCERTAIN TRACKING
TRACKING  AGREES    TRACKING
LOST      NO_PERSON LOST
LOST      DISAGREES LOST
LOST      UNCERTAIN LOST
LOST      AGREES    TRACKING
LOST      GIVEN_UP  SEARCHING
"""
TABLE = [tuple(line.split()) for line in EXPECTED.split("\n") if line]


@pytest.mark.parametrize(("before", "event", "after"), TABLE)
def test_every_transition(before, event, after):
    assert Track(Phase[before]).after(Event[event], 5).phase is Phase[after]


def test_there_are_no_other_transitions():
    stated = {(before, event) for before, event, _ in TABLE}
    for phase, event in product(Phase, Event):
        assert (event in TRANSITIONS[phase]) == ((phase.name, event.name) in stated)
    with pytest.raises(KeyError):
        Track(Phase.TRACKING).after(Event.FOUND, 5)


def test_settling_is_reported_as_tracking():
    states = [TrackState.SEARCHING, TrackState.TRACKING, TrackState.TRACKING, TrackState.LOST]
    assert [phase.state for phase in Phase] == states


@pytest.mark.parametrize("phase", [Phase.TRACKING, Phase.LOST])
def test_an_overlap_between_the_thresholds_does_not_change_the_phase(phase):
    track = Track(phase)
    for step in range(20):
        overlap = MIDDLE + (0.05 if step % 2 else -0.05)
        track = track.after(event_of(overlap), step, overlap)
        assert track.phase is phase


def test_patience_begins_with_the_first_of_consecutive_lost_frames():
    track = Track(Phase.TRACKING).after(Event.AGREES, 0, 0.8)
    assert track.mean_overlap == pytest.approx(0.8)
    track = track.after(Event.NO_PERSON, 10)
    assert not track.given_up
    assert not track.after(Event.DISAGREES, 10 + PATIENCE_NS - 1).given_up
    assert track.after(Event.DISAGREES, 10 + PATIENCE_NS).given_up
    track = track.after(Event.AGREES, 20, 0.8).after(Event.NO_PERSON, 30)
    assert not track.after(Event.NO_PERSON, 10 + PATIENCE_NS).given_up
    given_up = track.after(Event.NO_PERSON, 30 + PATIENCE_NS)
    assert given_up.given_up
    assert given_up.after(Event.GIVEN_UP) == Track()


def test_only_tracked_frames_enter_the_mean_overlap():
    track = Track(Phase.TRACKING).after(Event.AGREES, 0, 0.8).after(Event.AGREES, 1, 0.6)
    assert track.mean_overlap == pytest.approx(0.79)
    assert track.after(Event.DISAGREES, 2, 0.1).mean_overlap == track.mean_overlap
    assert track.after(Event.NO_PERSON, 2).mean_overlap == track.mean_overlap


@given(st.lists(st.tuples(st.sampled_from(FRAME_EVENTS), st.integers(), st.floats(0.0, 1.0))))
def test_any_events_leave_a_consistent_track(frames):
    track = Track()
    for event, stamp_ns, overlap in frames:
        if track.given_up:
            track = track.after(Event.GIVEN_UP)
        if event not in TRANSITIONS[track.phase]:
            continue
        track = track.after(event, stamp_ns, overlap)
        assert (track.lost_since_ns is None) == (track.phase is not Phase.LOST)
        assert 0.0 <= track.mean_overlap <= 1.0
        assert track.stamp_ns == stamp_ns
