"""Synthetic people: motions, cameras, images. Errors on them are no measure of accuracy.

`scenes` generates rooms and people in clothes that are not a tracker's cones, from `rooms` and
`people`.
"""

from markerless_tracker.synthesis.motion import MOTIONS, Motion
from markerless_tracker.synthesis.rig import MILD_LENS, MOST_CAMERAS, look_at, ring_rig
from markerless_tracker.synthesis.scene import LIGHTS, SyntheticScene

__all__ = [
    "LIGHTS",
    "MILD_LENS",
    "MOST_CAMERAS",
    "MOTIONS",
    "Motion",
    "SyntheticScene",
    "look_at",
    "ring_rig",
]
