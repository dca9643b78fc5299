"""Learns an empty scene from images as they come, as long as it is empty."""

import cv2
import numpy as np

from markerless_tracker.errors import ImageError
from markerless_tracker.imaging.background.mixture import MEDIAN_TO_SD
from markerless_tracker.imaging.background.model import (
    BackgroundModel,
    learn_background,
    model_from_moments,
)
from markerless_tracker.imaging.background.moments import Moments
from markerless_tracker.imaging.images import FloatImage, Image, check_image, grey_of
from markerless_tracker.imaging.masks import SOLID
from markerless_tracker.imaging.settings import ImagingSettings

MOVING_SHARE = 0.002
"""Least fraction of changed pixels that counts as motion: 630 px of 644x488, where a person has
thousands. Leaves and screens may have more: an empty scene with them is refused."""

SAMPLES = 20
"""Largest number of images kept for a mixture: 0.5 GB for four 1080p cameras."""

# Window over which images are averaged before they are compared.
_BLUR_PX = (5, 5)
# Least change of a pixel that moved: grey levels, and standard deviations of the noise.
_LEAST_CHANGE = 10.0
_NOISE_FACTOR = 6.0


class LiveBackground:
    """Learns the background of one camera; memory does not grow with the number of images.

    For one Gaussian per pixel the sums of `learn_background` are kept. For a mixture at most
    `SAMPLES` images are kept, evenly spaced.

    Args:
        camera: name for messages.
        settings: as in `learn_background`.
    """

    def __init__(self, camera: str, settings: ImagingSettings | None = None) -> None:
        self._camera = camera
        self._settings = settings or ImagingSettings()
        self._count = 0
        self._shape: tuple[int, ...] = ()
        self._samples: list[Image] = []
        self._every = 1
        self._moments = Moments()
        self._first: FloatImage | None = None

    def __len__(self) -> int:
        return self._count

    def add(self, image: Image) -> float:
        """Take an image (h, w) or (h, w, 3).

        Returns:
            The fraction of the pixels that differ from the first image by more than noise.

        Raises:
            ImageError: it differs from the first in size or channels.
        """
        check_image(image, f"{self._camera}: background frame {self._count}")
        if self._count == 0:
            self._shape = image.shape
        elif image.shape != self._shape:
            raise ImageError(
                f"{self._camera}: background frame {self._count} is {image.shape}, the first was "
                f"{self._shape}"
            )
        self._learn_from(image)
        smooth = np.asarray(cv2.blur(grey_of(image), _BLUR_PX), dtype=np.float32)
        if self._first is None:
            self._first = smooth
            return 0.0
        return moved_share(self._first, smooth)

    def learn(self) -> BackgroundModel:
        """The background.

        Raises:
            ImageError: no image came.
        """
        note = f"learned live from {self._count} images"
        if self._settings.background.modes > 1 or not self._count:
            return learn_background(self._samples, self._settings, camera=self._camera, note=note)
        moments = self._moments
        return model_from_moments(
            moments.mean, moments.squares, moments.count, self._settings, note=note
        )

    def _learn_from(self, image: Image) -> None:
        if self._settings.background.modes == 1:
            self._moments.add(image)
        elif self._count % self._every == 0:
            # The memory of a message may be reused.
            self._samples.append(image.copy())
            if len(self._samples) > SAMPLES:
                self._samples, self._every = self._samples[::2], 2 * self._every
        self._count += 1


def moved_share(before: FloatImage, now: FloatImage) -> float:
    """The fraction of a smoothed grey image (h, w) that differs from another by more than noise.

    A change of brightness of the whole image does not count.
    """
    gain = float(np.median((now + 1.0) / (before + 1.0)))
    change = np.abs(now - gain * before)
    noise = MEDIAN_TO_SD * float(np.median(change))
    moved = (change > max(_LEAST_CHANGE, _NOISE_FACTOR * noise)).astype(np.uint8)
    return cv2.countNonZero(cv2.morphologyEx(moved, cv2.MORPH_OPEN, SOLID)) / moved.size
