"""From camera images to evidence: background, shadows, silhouette, edges."""

from markerless_tracker.imaging.background import BackgroundModel, learn_background
from markerless_tracker.imaging.images import Image, check_image, scale_image
from markerless_tracker.imaging.segmenter import Segmenter
from markerless_tracker.imaging.settings import ImagingSettings

__all__ = [
    "BackgroundModel",
    "Image",
    "ImagingSettings",
    "Segmenter",
    "check_image",
    "learn_background",
    "scale_image",
]
