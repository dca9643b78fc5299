"""Whether the body is still tracked: a pure test on how well the silhouettes agree."""

from markerless_tracker.records import TrackState

LOST_BELOW = 0.40
REGAINED_ABOVE = 0.55


def next_state(state: TrackState, overlap: float) -> TrackState:
    """State after a frame whose mean overlap (IoU of body and silhouettes) is given.

    One threshold to lose the track and a higher one to regain it, so that it does not flicker.
    """
    if overlap >= REGAINED_ABOVE or (overlap >= LOST_BELOW and state is not TrackState.LOST):
        return TrackState.TRACKING
    return TrackState.LOST
