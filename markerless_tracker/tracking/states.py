"""Phases of a track and the transitions between them.

An event classifies one frame; `TRANSITIONS` holds the phase that follows. `loss.event_of` makes the
event from the frame's overlap.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum

from markerless_tracker.records import TrackState

PATIENCE_NS = 100_000_000
"""Time for which a lost body is searched near its last pose before it is searched everywhere."""
_MEMORY = 0.05
"""Weight of a frame in the running mean of the overlap."""


class Phase(Enum):
    """What the tracker does with the next frame."""

    SEARCHING = "SEARCHING"
    """There is no pose: wait for the start pose, or search the room for a person."""
    SETTLING = "SETTLING"
    """An automatic start found a person; further frames confirm the heading and fit the body."""
    TRACKING = "TRACKING"
    """The body is searched near its predicted pose."""
    LOST = "LOST"
    """As TRACKING, but the silhouettes no longer agree with the body."""

    @property
    def state(self) -> TrackState:
        """What is reported: SETTLING counts as TRACKING, since it has a pose."""
        return TrackState.TRACKING if self is Phase.SETTLING else TrackState[self.name]


class Event(Enum):
    """What a frame's silhouettes show about the body."""

    NO_PERSON = "NO_PERSON"
    """There is no silhouette in any usable view, or none of a person."""
    FOUND = "FOUND"
    """The automatic start found a person, and needs further frames."""
    DISAGREES = "DISAGREES"
    """The overlap of body and silhouettes lies below the lower threshold."""
    UNCERTAIN = "UNCERTAIN"
    """The overlap lies between the thresholds."""
    AGREES = "AGREES"
    """The overlap reaches the upper threshold."""
    GIVEN_UP = "GIVEN_UP"
    """The body has been lost for longer than `PATIENCE_NS`."""


_S, _C, _T, _L = Phase.SEARCHING, Phase.SETTLING, Phase.TRACKING, Phase.LOST

TRANSITIONS: Mapping[Phase, Mapping[Event, Phase]] = {
    _S: {
        Event.NO_PERSON: _S,
        Event.FOUND: _C,
        Event.DISAGREES: _L,
        Event.UNCERTAIN: _T,
        Event.AGREES: _T,
    },
    _C: {
        Event.NO_PERSON: _S,
        Event.FOUND: _C,
        Event.DISAGREES: _L,
        Event.UNCERTAIN: _T,
        Event.AGREES: _T,
    },
    _T: {
        Event.NO_PERSON: _L,
        Event.DISAGREES: _L,
        Event.UNCERTAIN: _T,
        Event.AGREES: _T,
    },
    _L: {
        Event.NO_PERSON: _L,
        Event.DISAGREES: _L,
        Event.UNCERTAIN: _L,
        Event.AGREES: _T,
        Event.GIVEN_UP: _S,
    },
}
"""The phase after an event, by the phase before it. Absent pairs cannot occur."""


@dataclass(frozen=True)
class Track:
    """Phase of a track, with what the next transition needs.

    Attributes:
        phase: after the last frame.
        mean_overlap: running mean of the tracked frames' overlap; 0 before the first.
        lost_since_ns: stamp of the first of the last consecutive lost frames; None while not lost.
        stamp_ns: of the last frame; None before the first.
    """

    phase: Phase = Phase.SEARCHING
    mean_overlap: float = 0.0
    lost_since_ns: int | None = None
    stamp_ns: int | None = None

    @property
    def state(self) -> TrackState:
        """The reported state."""
        return self.phase.state

    @property
    def given_up(self) -> bool:
        """Whether the body was lost for `PATIENCE_NS` at the last frame."""
        if self.lost_since_ns is None or self.stamp_ns is None:
            return False
        # If stamps run backwards, that gap counts, too.
        return abs(self.stamp_ns - self.lost_since_ns) >= PATIENCE_NS

    def after(self, event: Event, stamp_ns: int | None = None, overlap: float = 0.0) -> "Track":
        """The track after an event.

        Args:
            event: of the frame.
            stamp_ns: of the frame; None for `Event.GIVEN_UP`, which has no frame.
            overlap: of the frame.

        Raises:
            KeyError: the event cannot occur in this phase.
        """
        phase = TRANSITIONS[self.phase][event]
        if phase is Phase.SEARCHING:
            return Track(stamp_ns=stamp_ns)
        if phase is Phase.LOST:
            since_ns = stamp_ns if self.lost_since_ns is None else self.lost_since_ns
            return Track(phase, self.mean_overlap, since_ns, stamp_ns)
        rate = _MEMORY if self.mean_overlap else 1.0
        mean = self.mean_overlap + rate * (overlap - self.mean_overlap)
        return Track(phase, mean, None, stamp_ns)
