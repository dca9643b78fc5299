"""One threshold to lose the track, a higher one to regain it."""

import pytest

from markerless_tracker.records import TrackState
from markerless_tracker.tracking.loss import LOST_BELOW, REGAINED_ABOVE, next_state

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
