"""Makes evidence from camera images: background, silhouette, edge map."""

from markerless_tracker.imaging.background import (
    BackgroundModel,
    Mode,
    Plate,
    background_plate,
    learn_background,
    read_background_model,
    scale_background_model,
    write_background_model,
)
from markerless_tracker.imaging.edges import edge_map, edge_radius_px
from markerless_tracker.imaging.images import Image, check_image, scale_image
from markerless_tracker.imaging.region import Region
from markerless_tracker.imaging.segmentation import Segmenter
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
    "edge_map",
    "edge_radius_px",
    "learn_background",
    "read_background_model",
    "scale_background_model",
    "scale_image",
    "write_background_model",
]
