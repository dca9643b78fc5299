"""The background in the layout of the foreground test: Gaussians of every pixel, by channel."""

import cv2
import numpy as np
from numpy.typing import NDArray

from markerless_tracker.imaging.background.model import (
    BackgroundModel,
    foreground_limit,
    risk_of,
)
from markerless_tracker.imaging.images import FloatImage, Image, grey_of
from markerless_tracker.imaging.region import Region
from markerless_tracker.imaging.segmentation.planes import split_channels
from markerless_tracker.imaging.settings import ImagingSettings
from markerless_tracker.observation import locked

# Largest difference between the channels of a grey camera's background, grey levels.
_GREY_TOLERANCE = 0.5
_LUMA = np.array([0.114, 0.587, 0.299], dtype=np.float32)
# Window of the Gaussian blur of noisy images.
_SMOOTH_PX = (5, 5)
# Mean of a mode that a pixel lacks, so that no value is near it or in its shadow.
_NOWHERE = np.float32(-1e6)


class BackgroundGaussians:
    """One camera's background, prepared for comparison with images.

    Images of grey cameras are compared in one channel, noisy images after a blur.

    Args:
        camera: the camera's name.
        background: its empty scene.
        settings: those of the foreground test.

    Attributes:
        is_grey: whether one channel has all information.
        mean: (k, c, h, w) float32 grey levels, means of the k Gaussians of each pixel.
        scale: (k, c, h, w) float32, 1 / (sigma sqrt(limit)): the foreground test is |.|^2 > 1.
        grey_mean: (h, w) float32, the first Gaussian's mean as a grey image.
        sigma: median noise of the grey image, grey levels.
        smooths: whether images are blurred before they are compared.
        size_px: (width, height).
    """

    def __init__(self, camera: str, background: BackgroundModel, settings: ImagingSettings) -> None:
        self._camera = camera
        self._background = background
        self._settings = settings
        # Three equal channels are those of a grey camera.
        spread = background.mean.max(axis=2) - background.mean.min(axis=2)
        self.is_grey = background.channels == 1 or bool(spread.max() <= _GREY_TOLERANCE)
        sigma = float(np.sqrt(np.median(background.variance)))
        # Not a mixture: many pixels have no second Gaussian, and a blur would mix them in.
        self.smooths = sigma > settings.background.denoise_sigma and not background.modes
        self.mean, self.scale = self._learned()
        mean, variance = self._smoothed(background.mean, background.variance)
        if self.is_grey:
            self.grey_mean = np.ascontiguousarray(mean[:, :, 0])
            self.sigma = float(np.sqrt(np.median(variance[:, :, 0])))
        else:
            self.grey_mean = np.ascontiguousarray(mean @ _LUMA, dtype=np.float32)
            self.sigma = float(np.sqrt(np.median(variance @ _LUMA**2)))
        self.size_px = background.size_px

    def reset(self) -> None:
        """Restore `mean` as learned, in place, and `grey_mean`."""
        self.mean[...] = self._learned()[0]
        self.grey_changed()

    def grey_changed(self) -> None:
        """Compute `grey_mean` from `mean`, which has changed."""
        first = self.mean[0]
        grey = first[0].copy() if self.is_grey else np.tensordot(_LUMA, first, 1)
        # All images are as writable as at first, so that kernels are compiled once.
        grey = np.ascontiguousarray(grey, dtype=np.float32)
        grey.flags.writeable = self.grey_mean.flags.writeable
        self.grey_mean = grey

    def pixels(self, image: Image, region: Region) -> Image:
        """Pixels (h, w, c) of a region for comparison: smoothed if noisy, one channel if grey.

        The array is contiguous and must not be written.
        """
        source, place = self._source(image, region)
        part = source[place.slices]
        if self.is_grey:
            part = grey_of(part)
        # All images are read-only, so that kernels are compiled once.
        return locked(part.reshape(region.height, region.width, -1), np.uint8)

    def planes(self, image: Image, region: Region, memory: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Pixels of a region as `pixels`, by channel: (c, h, w), which must not be written.

        Args:
            image: the whole image.
            region: the part of it.
            memory: at least (3 h w,) if there are three channels, which are written into it.
        """
        source, place = self._source(image, region)
        if self.is_grey:
            return np.ascontiguousarray(grey_of(source[place.slices]))[None]
        channels = memory[: 3 * place.width * place.height].reshape(3, place.height, place.width)
        split_channels(source, place, channels)
        return channels

    def grey(self, image: Image, region: Region) -> Image:
        """Pixels (h, w) of a region as `pixels`, but always as a grey image."""
        source, place = self._source(image, region)
        return locked(grey_of(source[place.slices]), np.uint8)

    def _source(self, image: Image, region: Region) -> tuple[Image, Region]:
        """An image that has the region of ``image``, blurred if noisy, and its place in it."""
        if not self.smooths:
            return image, region
        wide = region.grown(_SMOOTH_PX[0] // 2, self.size_px)
        blurred = np.asarray(cv2.GaussianBlur(image[wide.slices], _SMOOTH_PX, 0.0), dtype=np.uint8)
        return blurred, region.relative_to(wide)

    def _smoothed(self, mean: FloatImage, variance: FloatImage) -> tuple[FloatImage, FloatImage]:
        """Mean and variance (h, w, c) for comparison: smoothed if too noisy."""
        if not self.smooths:
            return mean, variance
        smooth = np.asarray(cv2.GaussianBlur(mean, _SMOOTH_PX, 0.0), dtype=np.float32)
        row = cv2.getGaussianKernel(_SMOOTH_PX[0], 0.0, cv2.CV_64F)
        less = np.maximum(
            variance * float((row**2).sum() ** 2), self._settings.background.sigma_min**2
        )
        return smooth.reshape(mean.shape), less.astype(np.float32)

    def _learned(self) -> tuple[FloatImage, FloatImage]:
        """Means and 1 / (sigma sqrt(limit)) of all modes, (k, c, h, w) each."""
        background = self._background
        channels = slice(0, 1) if self.is_grey else slice(None)
        rest = np.ones(background.mean.shape[:2], dtype=np.float32)
        for mode in background.modes:
            rest -= mode.weight
        modes = [(rest, background.mean, background.variance)]
        modes += [(mode.weight, mode.mean, mode.variance) for mode in background.modes]
        risk = risk_of(self._camera, self._settings)
        means, scales = [], []
        for weight, mean, variance in modes:
            mean, variance = self._smoothed(mean[:, :, channels], variance[:, :, channels])
            mean, variance = (a.reshape(*rest.shape, -1) for a in (mean, variance))
            there = weight[:, :, None] > 0.0
            variance = np.where(there, variance, np.float32(1.0))
            limit = foreground_limit(variance, risk, weight=weight)
            means.append(np.where(there, mean, _NOWHERE))
            scales.append(1.0 / np.sqrt(variance * limit[:, :, None]))
        return _planar(means), _planar(scales)


def _planar(images: list[FloatImage]) -> FloatImage:
    """Images (h, w, c) as one array (k, c, h, w)."""
    return np.ascontiguousarray(np.moveaxis(np.stack(images), -1, 1), dtype=np.float32)
