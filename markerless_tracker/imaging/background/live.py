"""Learning an empty scene from images as they come, as long as it is empty."""

import cv2
import numpy as np
from numpy.typing import NDArray

from markerless_tracker.imaging.background.model import BackgroundModel, learn_background
from markerless_tracker.imaging.images import Image, grey_of
from markerless_tracker.imaging.settings import ImagingSettings

MOVING_SHARE = 0.002
"""Part of an image from which on something moves in it: 630 px of 644x488, where a person has some
thousands; leaves and screens may have more, and an empty scene with them is refused."""

_BLUR_PX = (5, 5)
_LEAST_CHANGE = 10.0
_NOISE_FACTOR = 6.0
_SOLID = np.ones((3, 3), dtype=np.uint8)
# A normal distribution's deviation beside its median deviation.
_FROM_MEDIAN = 1.4826


class LiveBackground:
    """Images of one camera that are to become its background.

    Args:
        camera: name for messages.
        settings: as in `learn_background`.
    """

    def __init__(self, camera: str, settings: ImagingSettings | None = None) -> None:
        self._camera = camera
        self._settings = settings
        self._images: list[Image] = []
        self._first: NDArray[np.float32] | None = None

    def __len__(self) -> int:
        return len(self._images)

    def add(self, image: Image) -> float:
        """Take an image (h, w) or (h, w, 3); returns the part of it that moved since the first."""
        # Messages' memory may be used again.
        self._images.append(image.copy())
        smooth = np.asarray(cv2.blur(grey_of(image), _BLUR_PX), dtype=np.float32)
        if self._first is None or self._first.shape != smooth.shape:
            self._first = smooth
            return 0.0
        return moved_share(self._first, smooth)

    def learn(self) -> BackgroundModel:
        """The background.

        Raises:
            ImageError: no image came, or images that differ in size or channels.
        """
        note = f"learned live from {len(self._images)} images"
        return learn_background(self._images, self._settings, camera=self._camera, note=note)


def moved_share(before: NDArray[np.float32], now: NDArray[np.float32]) -> float:
    """The part of a smoothed grey image (h, w) that differs from another by more than noise.

    A change of brightness of the whole image is none.
    """
    gain = float(np.median((now + 1.0) / (before + 1.0)))
    change = np.abs(now - gain * before)
    noise = _FROM_MEDIAN * float(np.median(change))
    moved = (change > max(_LEAST_CHANGE, _NOISE_FACTOR * noise)).astype(np.uint8)
    return cv2.countNonZero(cv2.morphologyEx(moved, cv2.MORPH_OPEN, _SOLID)) / moved.size
