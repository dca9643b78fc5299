"""One threshold to lose the track, a higher one to regain it."""

import pytest

from markerless_tracker.fitness import ViewTerms
from markerless_tracker.records import TrackState
from markerless_tracker.tracking.loss import (
    DISAGREEING,
    LIMB_LOST_BELOW,
    LIMB_REGAINED_ABOVE,
    LOST_BELOW,
    PATIENCE_NS,
    REGAINED_ABOVE,
    LimbTrack,
    Track,
    next_limb_state,
    next_state,
    shared_overlap,
)

SEARCHING, TRACKING, LOST = TrackState.SEARCHING, TrackState.TRACKING, TrackState.LOST
MIDDLE = 0.5 * (LOST_BELOW + REGAINED_ABOVE)


def test_there_is_room_between_the_thresholds():
    assert 0.0 < LOST_BELOW < REGAINED_ABOVE < 1.0


@pytest.mark.parametrize(
    ("state", "overlap", "expected"),
    [
        (SEARCHING, 0.0, LOST),
        (SEARCHING, MIDDLE, TRACKING),
        (SEARCHING, 1.0, TRACKING),
        (TRACKING, LOST_BELOW - 1e-9, LOST),
        (TRACKING, LOST_BELOW, TRACKING),
        (TRACKING, MIDDLE, TRACKING),
        (LOST, 0.0, LOST),
        (LOST, MIDDLE, LOST),
        (LOST, REGAINED_ABOVE - 1e-9, LOST),
        (LOST, REGAINED_ABOVE, TRACKING),
        (TRACKING, float("nan"), LOST),
    ],
)
def test_transitions(state, overlap, expected):
    assert next_state(state, overlap) is expected


def test_an_overlap_that_hovers_between_the_thresholds_does_not_flicker():
    for state in (TRACKING, LOST):
        seen = state
        for step in range(20):
            seen = next_state(seen, MIDDLE + (0.05 if step % 2 else -0.05))
            assert seen is state


def test_a_track_that_fits_well_is_lost_sooner():
    assert next_state(TRACKING, 0.6, 0.9) is LOST
    assert next_state(TRACKING, 0.6, 0.7) is TRACKING
    assert next_state(LOST, 0.7, 0.9) is LOST
    assert next_state(LOST, 0.8, 0.9) is TRACKING


def test_patience_begins_with_the_first_lost_frame_in_a_row():
    track = Track()
    for stamp_ns in range(3):
        assert track.note(0.8, stamp_ns) is TRACKING
    assert track.usual == pytest.approx(0.8)
    assert track.note(0.0, 10) is LOST and not track.given_up(10 + PATIENCE_NS - 1)
    assert track.given_up(10 + PATIENCE_NS)
    track.note(0.8, 20)
    track.note(0.0, 30)
    assert not track.given_up(10 + PATIENCE_NS) and track.given_up(30 + PATIENCE_NS)
    # Stamps may be set back.
    assert track.given_up(30 - PATIENCE_NS)


def test_views_count_by_what_they_show() -> None:
    well, badly = ViewTerms(0.9, 0.0, 0.9, 3000.0), ViewTerms(0.0, 0.0, 0.0, 1000.0)
    assert shared_overlap([well, badly]) == pytest.approx(0.675)
    edge, nobody = ViewTerms(0.0, 0.0, 0.0, 3.0), ViewTerms(1.0, 0.0, 1.0, 0.0)
    assert shared_overlap([well, well, edge, nobody]) == pytest.approx(0.9, abs=1e-3)
    assert shared_overlap([nobody]) == 1.0


LIMB_MIDDLE = 0.5 * (LIMB_LOST_BELOW + LIMB_REGAINED_ABOVE)
NAN = float("nan")


@pytest.mark.parametrize(
    ("state", "inside_fraction", "particle_sd_ratio", "expected"),
    [
        (TRACKING, LIMB_LOST_BELOW - 1e-9, 0.1, LOST),
        (TRACKING, LIMB_LOST_BELOW, 0.1, TRACKING),
        (TRACKING, LIMB_MIDDLE, 0.1 * DISAGREEING - 1e-9, TRACKING),
        (TRACKING, LIMB_MIDDLE, 0.1 * DISAGREEING + 1e-9, LOST),
        (TRACKING, LIMB_MIDDLE, NAN, TRACKING),
        (TRACKING, LIMB_REGAINED_ABOVE, 9.0, TRACKING),
        (LOST, LIMB_MIDDLE, 0.0, LOST),
        (LOST, LIMB_REGAINED_ABOVE - 1e-9, 0.1, LOST),
        (LOST, LIMB_REGAINED_ABOVE, 0.1, TRACKING),
        (TRACKING, NAN, 0.1, TRACKING),
    ],
)
def test_a_limbs_transitions(state, inside_fraction, particle_sd_ratio, expected):
    assert next_limb_state(state, inside_fraction, particle_sd_ratio, usual=0.1) is expected


def test_a_swarm_does_not_count_until_its_usual_scatter_is_known():
    assert next_limb_state(TRACKING, LIMB_MIDDLE, 9.0) is TRACKING


def test_a_limb_remembers_the_scatter_of_the_frames_that_were_tracked():
    limb = LimbTrack()
    assert limb.note(1.0, 0.1) is TRACKING and limb.usual == pytest.approx(0.1)
    assert limb.note(1.0, NAN) is TRACKING and limb.usual == pytest.approx(0.1)
    assert limb.note(0.9, 0.14) is TRACKING and limb.usual == pytest.approx(0.102)
    assert limb.note(LIMB_MIDDLE, 0.2) is LOST and limb.usual == pytest.approx(0.102)
    assert limb.note(LIMB_MIDDLE, 0.1) is LOST
    assert limb.note(0.9, 0.1) is TRACKING and limb.usual < 0.102
