"""Learns a background from the person's own recording."""

from collections.abc import Iterable

import numpy as np

from markerless_tracker.errors import ImageError
from markerless_tracker.imaging.background.model import BackgroundModel
from markerless_tracker.imaging.background.steady import ALONE_SHARE, steady_image, thinned
from markerless_tracker.imaging.images import Image, check_image
from markerless_tracker.imaging.settings import ImagingSettings

# Number of frames kept of the recording, which limits memory and time.
_FRAMES = 48


def learn_from_recording(
    frames: Iterable[Image],
    settings: ImagingSettings | None = None,
    *,
    camera: str = "background",
) -> BackgroundModel:
    """Learn a background from frames with the person, spread over the whole recording.

    The background is each pixel's steadiest value (see `steady.steady_image`). If the person covers
    a pixel for most of the time, or stands motionless, the person is learned as background and the
    silhouette has a hole. A person that never moves away is hardly segmented.

    Args:
        frames: any number, in temporal order; read once, a few dozen are kept.
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
