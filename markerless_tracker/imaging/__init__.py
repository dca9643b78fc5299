"""From camera images to evidence: background, shadows, silhouette, edges."""

from markerless_tracker.imaging.background.model import BackgroundModel, Mode, learn_background
from markerless_tracker.imaging.background.model_file import (
    read_background_model,
    write_background_model,
)
from markerless_tracker.imaging.background.model_scale import scale_background_model
from markerless_tracker.imaging.background.plate import Plate, background_plate
from markerless_tracker.imaging.background.recording import learn_from_recording
from markerless_tracker.imaging.images import Image, check_image, scale_image
from markerless_tracker.imaging.region import Region
from markerless_tracker.imaging.segmentation.segmenter import Segmenter
from markerless_tracker.imaging.settings import ImagingSettings

__all__ = [
    "BackgroundModel",
    "Image",
    "ImagingSettings",
    "Mode",
    "Plate",
    "Region",
    "Segmenter",
    "background_plate",
    "check_image",
    "learn_background",
    "learn_from_recording",
    "read_background_model",
    "scale_background_model",
    "scale_image",
    "write_background_model",
]
