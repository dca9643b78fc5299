"""A background where nothing but the person's own video exists."""

from collections.abc import Iterable

import numpy as np

from markerless_tracker.errors import ImageError
from markerless_tracker.imaging.background.model import BackgroundModel
from markerless_tracker.imaging.background.steady import ALONE_SHARE, steady_image, thinned
from markerless_tracker.imaging.images import Image, check_image
from markerless_tracker.imaging.settings import ImagingSettings

# Frames kept of the recording; their number bounds memory and time.
_FRAMES = 48


def learn_from_recording(
    frames: Iterable[Image],
    settings: ImagingSettings | None = None,
    *,
    camera: str = "background",
) -> BackgroundModel:
    """Background from frames in which the person is, spread over the whole recording.

    Each pixel's most steady value (see `steady.steady_image`). The price: a place that the person
    covers for most of the time, or where he stands quite still, is learned as the person, and the
    silhouette has a hole there; of someone who never leaves his place little is found.

    Args:
        frames: frames in the order of time, any number; read once, a few dozen are kept.
        settings: `background.sigma_min` and, for a single frame, `background.sigma_still`.
        camera: name for error messages.

    Raises:
        ImageError: no frame came, or frames of different kinds.
    """
    settings = settings or ImagingSettings()
    chosen: list[Image] = []
    for index, frame in thinned(frames, _FRAMES):
        check_image(frame, f"{camera}: frame {index}")
        if chosen and frame.shape != chosen[0].shape:
            raise ImageError(
                f"{camera}: frame {index} is {frame.shape}, the first was {chosen[0].shape}"
            )
        chosen.append(frame)
    if not chosen:
        raise ImageError(f"{camera}: no frame came to learn a background from")
    first = chosen[0]
    stack = np.stack(chosen).reshape(len(chosen), first.shape[0], first.shape[1], -1)
    mean, variance = steady_image(stack, share=ALONE_SHARE)
    least = settings.background.sigma_still if len(chosen) == 1 else settings.background.sigma_min
    note = (
        f"the most steady value of {len(chosen)} frames of the recording itself: places that the "
        "person covers for most of the time are learned as the person"
    )
    return BackgroundModel(mean, np.maximum(variance, least**2), note)
