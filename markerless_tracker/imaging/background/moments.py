"""Mean and squared deviations of each pixel over images that come one by one."""

import numpy as np

from markerless_tracker.imaging.images import FloatImage, Image


class Moments:
    """Sums over images of one shape, after Welford (1962), with memory for two images.

    Attributes:
        count: number of images.
        mean: (h, w, c) float32, grey levels.
        squares: (h, w, c) float32, summed squared deviations from the mean.
    """

    def __init__(self) -> None:
        self.count = 0
        self.mean: FloatImage = np.zeros(0, dtype=np.float32)
        self.squares: FloatImage = np.zeros(0, dtype=np.float32)

    def add(self, image: Image) -> None:
        """Add an image (h, w) or (h, w, c)."""
        value = image.reshape(*image.shape[:2], -1).astype(np.float32)
        if self.count == 0:
            self.mean, self.squares = np.zeros_like(value), np.zeros_like(value)
        self.count += 1
        change = value - self.mean
        self.mean += change / np.float32(self.count)
        self.squares += change * (value - self.mean)
