"""Whether the body, or a limb, is still tracked: pure tests on how well the silhouettes agree."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from markerless_tracker.fitness import ViewTerms
from markerless_tracker.records import TrackState
from markerless_tracker.tracking.states import Event

LOST_BELOW, REGAINED_ABOVE = 0.40, 0.55
"""Overlap (IoU) below which a track is lost, and from which on it is regained."""
LOST_FRACTION, REGAINED_FRACTION = 0.75, 0.85
"""The same relative to the mean overlap of the track."""
LEAST_FIT = 0.62
"""f_s from which on silhouettes are a person's in that pose: objects score lower. Bodies are only
found in, and fitted to, frames that reach it."""
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


def silhouette_fit(views: Iterable[ViewTerms]) -> float:
    """f_s of a pose, mean over some views; compare with `LEAST_FIT`."""
    return float(np.mean([view.silhouette for view in views]))


def event_of(overlap: float, mean_overlap: float = 0.0) -> Event:
    """What a frame with some overlap (IoU of body and silhouettes) says about the body.

    Two thresholds give hysteresis: a track is lost below the lower one and regained above the
    upper one.

    Args:
        overlap: of the frame; NaN disagrees.
        mean_overlap: of the track's frames so far, 0 if unknown: one that fits well is lost sooner.
    """
    if overlap >= max(REGAINED_ABOVE, REGAINED_FRACTION * mean_overlap):
        return Event.AGREES
    if overlap >= max(LOST_BELOW, LOST_FRACTION * mean_overlap):
        return Event.UNCERTAIN
    return Event.DISAGREES


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
