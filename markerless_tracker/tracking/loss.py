"""Decides whether the body and each limb are lost or regained: pure functions of a frame's fit."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from markerless_tracker.fitness import ViewTerms
from markerless_tracker.records import TrackState
from markerless_tracker.tracking.states import Event

LOST_BELOW, REGAINED_ABOVE = 0.40, 0.55
"""Overlap (IoU) below which a track is lost, and at or above which it is regained."""
LOST_FRACTION, REGAINED_FRACTION = 0.75, 0.85
"""The same relative to the mean overlap of the track."""
LEAST_FIT = 0.62
"""Least f_s of a person's pose: objects score lower. A start needs it, and bodies are fitted only
to frames that have it."""
LIMB_LOST_BELOW = 0.55
LIMB_REGAINED_ABOVE = 0.75
"""Fraction of a limb's axis inside the silhouettes, mean over the views: a limb is lost below the
first threshold and regained at the second."""
SCATTERED = 1.5
"""A swarm has not converged if its particle_sd_ratio exceeds the limb's mean by this factor."""
_MEMORY = 0.05
"""Weight of a frame in the running mean of a limb's particle_sd_ratio."""


def shared_overlap(views: Iterable[ViewTerms]) -> float:
    """Overlap (IoU) of body and silhouettes over several views.

    Views are weighted by the number of pixels that body or silhouette cover. 1 without such pixels.
    """
    seen = list(views)
    pixels = sum(view.pixels for view in seen)
    return sum(view.overlap * view.pixels for view in seen) / pixels if pixels > 0.0 else 1.0


def silhouette_fit(views: Iterable[ViewTerms]) -> float:
    """f_s of a pose, mean over the views; compare with `LEAST_FIT`."""
    return float(np.mean([view.silhouette for view in views]))


def event_of(overlap: float, mean_overlap: float = 0.0) -> Event:
    """The event of a frame, given its overlap (IoU of body and silhouettes).

    Two thresholds give hysteresis: a track is lost below the lower one and regained above the
    upper one.

    Args:
        overlap: of the frame; NaN disagrees.
        mean_overlap: of the track's frames so far, 0 if unknown; the higher, the sooner it is lost.
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
    mean_sd_ratio: float = math.nan,
) -> TrackState:
    """State of a limb after a frame.

    A limb outside the silhouettes is lost, a limb inside them is tracked. In between the state does
    not change, except that a limb whose swarm has not converged is lost.

    Args:
        state: before the frame.
        inside_fraction: fraction of the limb's axis inside the silhouettes.
        particle_sd_ratio: of the limb's swarm, see `LimbState`; NaN without a swarm.
        mean_sd_ratio: mean particle_sd_ratio of this limb's tracked frames, NaN if unknown.
    """
    if inside_fraction >= LIMB_REGAINED_ABOVE:
        return TrackState.TRACKING
    scattered = particle_sd_ratio > SCATTERED * mean_sd_ratio
    if inside_fraction < LIMB_LOST_BELOW or scattered or state is TrackState.LOST:
        return TrackState.LOST
    return TrackState.TRACKING


@dataclass
class LimbTrack:
    """State of a limb, with what `next_limb_state` needs.

    Attributes:
        state: after the last frame.
        mean_sd_ratio: running mean of particle_sd_ratio over tracked frames; NaN before the first.
    """

    state: TrackState = TrackState.TRACKING
    mean_sd_ratio: float = math.nan

    def note(self, inside_fraction: float, particle_sd_ratio: float) -> TrackState:
        """The state after a frame, see `next_limb_state`."""
        self.state = next_limb_state(
            self.state, inside_fraction, particle_sd_ratio, self.mean_sd_ratio
        )
        if self.state is TrackState.TRACKING and math.isfinite(particle_sd_ratio):
            known = math.isfinite(self.mean_sd_ratio)
            self.mean_sd_ratio = (
                self.mean_sd_ratio + _MEMORY * (particle_sd_ratio - self.mean_sd_ratio)
                if known
                else particle_sd_ratio
            )
        return self.state
