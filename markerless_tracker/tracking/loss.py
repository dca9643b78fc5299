"""Thresholds for losing and regaining the body and each limb: pure functions of a frame's fit."""

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
"""Least f_s of a pose that is a person's: objects score lower. Bodies are found in, and fitted to,
no other frames."""
LIMB_LOST_BELOW = 0.55
LIMB_REGAINED_ABOVE = 0.75
"""Fraction of a limb's axis inside the silhouettes, mean over the views: a limb is lost below the
first and regained from the second on."""
SCATTERED = 1.5
"""A swarm has not converged if its particle_sd_ratio exceeds the limb's mean by this factor."""
_MEMORY = 0.05


def shared_overlap(views: Iterable[ViewTerms]) -> float:
    """Overlap (IoU) of body and silhouettes in some views together.

    Views are weighted by the pixels that body or silhouette cover. 1 if no view has any.
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
    mean_sd_ratio: float = math.nan,
) -> TrackState:
    """State of a limb after a frame.

    A limb outside the silhouettes is lost, one inside them is tracked. In between the state stays,
    except that a limb whose swarm has not converged is lost.

    Args:
        state: before the frame.
        inside_fraction: of the limb's axis, how much lies inside the silhouettes.
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
    """State of a limb, and what `next_limb_state` depends on.

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
