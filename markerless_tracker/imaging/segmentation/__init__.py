"""Segments one image: finds the silhouette of the person.

Pixels are labelled (background, shadow, foreground); then patches, border and contour are repaired.
"""

from markerless_tracker.imaging.segmentation.morphology import clean_mask
from markerless_tracker.imaging.segmentation.segmenter import Segmenter

__all__ = ["Segmenter", "clean_mask"]
