"""The background: what a camera's images show without the person.

It is learned from empty frames or from recordings of the person, stored in files, and adapted to
slow changes.
"""

from markerless_tracker.imaging.background.live import MOVING_SHARE, LiveBackground
from markerless_tracker.imaging.background.model import BackgroundModel, Mode, learn_background
from markerless_tracker.imaging.background.model_file import (
    SUFFIX as MODEL_SUFFIX,
)
from markerless_tracker.imaging.background.model_file import (
    read_background_model,
    write_background_model,
)
from markerless_tracker.imaging.background.model_scale import scale_background_model
from markerless_tracker.imaging.background.plate import Plate, background_plate

__all__ = [
    "MODEL_SUFFIX",
    "MOVING_SHARE",
    "BackgroundModel",
    "LiveBackground",
    "Mode",
    "Plate",
    "background_plate",
    "learn_background",
    "read_background_model",
    "scale_background_model",
    "write_background_model",
]
