"""From one image to the silhouette of the person.

Labels of pixels (background, shadow, foreground), then repair of patches, border and contour.
"""

from markerless_tracker.imaging.segmentation.morphology import clean_mask
from markerless_tracker.imaging.segmentation.segmenter import Segmenter

__all__ = ["Segmenter", "clean_mask"]
