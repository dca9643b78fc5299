"""From camera images to evidence: background, shadows, silhouette, edges."""

from markerless_tracker.imaging.background import BackgroundModel, learn_background
from markerless_tracker.imaging.images import Image, check_image, scale_image
from markerless_tracker.imaging.plate import Plate, background_plate
from markerless_tracker.imaging.recording import learn_from_recording
from markerless_tracker.imaging.segmenter import Segmenter
from markerless_tracker.imaging.settings import ImagingSettings

__all__ = [
    "BackgroundModel",
    "Image",
    "ImagingSettings",
    "Plate",
    "Segmenter",
    "background_plate",
    "check_image",
    "learn_background",
    "learn_from_recording",
    "scale_image",
]
