"""Texture test: a shadow keeps the background's pattern, a body hides it."""

from markerless_tracker.imaging.segmentation.texture.correct import (
    correct_labels,
    correction_radius_px,
)

__all__ = ["correct_labels", "correction_radius_px"]
