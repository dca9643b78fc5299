"""Whether the body, or a limb, is still tracked: pure tests on how well the silhouettes agree."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

from markerless_tracker.fitness import ViewTerms
from markerless_tracker.records import TrackState

LOST_BELOW = 0.40
REGAINED_ABOVE = 0.55
LOST_SHARE, REGAINED_SHARE = 0.75, 0.85
"""The same as shares of the overlap that this track usually has."""
PATIENCE_NS = 100_000_000
"""How long a body may be lost before it is looked for anew."""
LIMB_LOST_BELOW = 0.55
LIMB_REGAINED_ABOVE = 0.75
"""Shares of a limb's axis inside the silhouettes, mean over the views."""
DISAGREEING = 1.5
"""A swarm disagrees if its particle_sd_ratio exceeds the limb's usual one by this factor."""
_MEMORY = 0.05


def shared_overlap(views: Iterable[ViewTerms]) -> float:
    """Overlap (IoU) of body and silhouettes in some views together.

    Views count by what they show: a hand at the edge of one hardly does, nobody in one not at all.
    1 if nobody is in any, nor should be.
    """
    seen = list(views)
    pixels = sum(view.pixels for view in seen)
    return sum(view.overlap * view.pixels for view in seen) / pixels if pixels > 0.0 else 1.0


def next_state(state: TrackState, overlap: float, usual: float = 0.0) -> TrackState:
    """State after a frame whose mean overlap (IoU of body and silhouettes) is given.

    One threshold to lose the track and a higher one to regain it, so that it does not flicker.

    Args:
        state: before the frame.
        overlap: of the frame; 0 if no view could be used.
        usual: the overlap that this track usually has, 0 if unknown.
    """
    regained = max(REGAINED_ABOVE, REGAINED_SHARE * usual)
    lost = max(LOST_BELOW, LOST_SHARE * usual)
    if overlap >= regained or (overlap >= lost and state is not TrackState.LOST):
        return TrackState.TRACKING
    return TrackState.LOST


def next_limb_state(
    state: TrackState,
    inside_fraction: float,
    particle_sd_ratio: float = math.nan,
    usual: float = math.nan,
) -> TrackState:
    """State of a limb after a frame.

    A limb outside the silhouettes is lost, one inside them is tracked. In between the state stays,
    but for a limb whose swarm does not agree where it is: that one is lost, too.

    Args:
        state: before the frame.
        inside_fraction: of the limb's axis, how much lies inside the silhouettes.
        particle_sd_ratio: of the limb's swarm, see `LimbState`; NaN without a swarm.
        usual: the particle_sd_ratio that this limb usually has, NaN if unknown.
    """
    if inside_fraction >= LIMB_REGAINED_ABOVE:
        return TrackState.TRACKING
    disagreeing = particle_sd_ratio > DISAGREEING * usual
    if inside_fraction < LIMB_LOST_BELOW or disagreeing or state is TrackState.LOST:
        return TrackState.LOST
    return TrackState.TRACKING


@dataclass
class LimbTrack:
    """What a limb's frames were like, for `next_limb_state`.

    Attributes:
        state: after the last frame.
        usual: running mean of particle_sd_ratio over tracked frames; NaN before the first.
    """

    state: TrackState = TrackState.TRACKING
    usual: float = math.nan

    def note(self, inside_fraction: float, particle_sd_ratio: float) -> TrackState:
        """The state after a frame, see `next_limb_state`."""
        self.state = next_limb_state(self.state, inside_fraction, particle_sd_ratio, self.usual)
        if self.state is TrackState.TRACKING and math.isfinite(particle_sd_ratio):
            known = math.isfinite(self.usual)
            self.usual = (
                self.usual + _MEMORY * (particle_sd_ratio - self.usual)
                if known
                else particle_sd_ratio
            )
        return self.state


@dataclass
class Track:
    """What a track's frames were like: for `next_state`, and for how long it has been lost.

    Attributes:
        state: after the last frame.
        usual: mean overlap of the tracked frames, recent ones counting more; 0 before the first.
        lost_since_ns: stamp of the first frame in a row that was lost, None while tracked.
    """

    state: TrackState = TrackState.SEARCHING
    usual: float = 0.0
    lost_since_ns: int | None = None

    def note(self, overlap: float, stamp_ns: int) -> TrackState:
        """Take a frame's overlap; returns the state after it."""
        self.state = next_state(self.state, overlap, self.usual)
        if self.state is TrackState.TRACKING:
            self.lost_since_ns = None
            rate = _MEMORY if self.usual else 1.0
            self.usual += rate * (overlap - self.usual)
        elif self.lost_since_ns is None:
            self.lost_since_ns = stamp_ns
        return self.state

    def given_up(self, stamp_ns: int) -> bool:
        """Whether it has been lost for too long to be found near where it was."""
        # Stamps may be set back: then too, it was long ago.
        return self.lost_since_ns is not None and abs(stamp_ns - self.lost_since_ns) >= PATIENCE_NS
