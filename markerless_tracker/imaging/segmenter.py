"""One camera's image to evidence: silhouette and edge map."""

import cv2
import numpy as np

from markerless_tracker.errors import ImageError
from markerless_tracker.imaging import kernels
from markerless_tracker.imaging.adapt import Adaptation
from markerless_tracker.imaging.background import (
    BackgroundModel,
    FloatImage,
    foreground_limit,
    risk_of,
)
from markerless_tracker.imaging.edges import edge_map
from markerless_tracker.imaging.exposure import exposure_gain
from markerless_tracker.imaging.images import Image, check_image, grey_of
from markerless_tracker.imaging.morphology import Mask, clean_mask, foreground_mask
from markerless_tracker.imaging.settings import ImagingSettings
from markerless_tracker.imaging.shadow import shadow_rule
from markerless_tracker.imaging.texture import correct_labels
from markerless_tracker.records import Observation

# Largest difference of a background's channels, grey levels, that still is a grey camera's.
_GREY_TOLERANCE = 0.5
_LUMA = np.array([0.114, 0.587, 0.299], dtype=np.float32)
# Window of the Gaussian blur that noisy images get.
_SMOOTH_PX = (5, 5)
_SOLID = np.ones((3, 3), dtype=np.uint8)
# Mean of a mode that a pixel lacks: nothing is near it, or in its shadow.
_NOWHERE = np.float32(-1e6)


class Segmenter:
    """Finds the person in one camera's images.

    Its scratch images are reused, so one segmenter serves one thread at a time; the segmenters of
    different cameras may run side by side (the compiled pass and OpenCV release the lock).

    Args:
        camera: the camera's name.
        background: its empty scene.
        settings: defaults if None.

    Raises:
        ImageError: no background for this camera.
    """

    def __init__(
        self,
        camera: str,
        background: BackgroundModel | None,
        settings: ImagingSettings | None = None,
    ) -> None:
        if background is None:
            raise ImageError(f"{camera}: no background came, expected one to tell the person from")
        self.camera = camera
        self.background = background
        self.settings = settings or ImagingSettings()
        # Three equal channels are a grey camera's: one carries all there is to know.
        spread = background.mean.max(axis=2) - background.mean.min(axis=2)
        self._grey = background.channels == 1 or bool(spread.max() <= _GREY_TOLERANCE)
        sigma = float(np.sqrt(np.median(background.variance)))
        self._smooth = sigma > self.settings.denoise_sigma
        self._mean, self._scale = self._gaussians()
        mean, variance = self._steady(background.mean, background.variance)
        if self._grey:
            self._grey_mean = np.ascontiguousarray(mean[:, :, 0])
            self._sigma = float(np.sqrt(np.median(variance[:, :, 0])))
        else:
            self._grey_mean = np.ascontiguousarray(mean @ _LUMA, dtype=np.float32)
            self._sigma = float(np.sqrt(np.median(variance @ _LUMA**2)))
        # The same memory with channels last, for what takes grey and colour alike.
        width, height = background.size_px
        shape = (len(self._mean), height, width, 1 if self._grey else 3)
        self._means_by_channel = self._mean.reshape(shape)
        self._scales_by_channel = self._scale.reshape(shape)
        self._gain = np.ones(shape[3], dtype=np.float32)
        options = self.settings
        self._adaptation = (
            Adaptation(options.background_follow_s, options.background_follow_margin_px)
            if options.background_follow_s > 0.0
            else None
        )
        self._rule = shadow_rule(self.settings, grey=self._grey)
        self._labels = np.empty((height, width), dtype=np.uint8)
        self._mask = np.empty_like(self._labels)
        share = options.shadow_grey_blob_share if self._grey else options.shadow_blob_share
        self._least_shadow_px = share * self._mask.size

    @property
    def gain(self) -> tuple[float, ...]:
        """Brightness of the last image relative to the background's, by channel."""
        return tuple(float(value) for value in self._gain)

    def reset(self) -> None:
        """Back to the background that was given; what was learned since is forgotten."""
        if self._adaptation is not None:
            self._adaptation.reset()
            self._mean[...] = self._gaussians()[0]
        self._gain[:] = 1.0

    def _steady(self, mean: FloatImage, variance: FloatImage) -> tuple[FloatImage, FloatImage]:
        """Mean and variance (h, w, c) of images as they are compared: smoothed if too noisy."""
        if not self._smooth:
            return mean, variance
        smooth = np.asarray(cv2.GaussianBlur(mean, _SMOOTH_PX, 0.0), dtype=np.float32)
        row = cv2.getGaussianKernel(_SMOOTH_PX[0], 0.0, cv2.CV_64F)
        less = np.maximum(
            variance * float((row**2).sum() ** 2), self.settings.background_sigma_min**2
        )
        return smooth.reshape(mean.shape), less.astype(np.float32)

    def _gaussians(self) -> tuple[FloatImage, FloatImage]:
        """Means and 1 / (sigma sqrt(limit)) of all modes, (k, h, w, c) or grey (k, h, w)."""
        background = self.background
        channels = slice(0, 1) if self._grey else slice(None)
        rest = np.ones(background.mean.shape[:2], dtype=np.float32)
        for mode in background.modes:
            rest -= mode.weight
        modes = [(rest, background.mean, background.variance)]
        modes += [(mode.weight, mode.mean, mode.variance) for mode in background.modes]
        risk = risk_of(self.camera, self.settings)
        means, scales = [], []
        for weight, mean, variance in modes:
            mean, variance = self._steady(mean[:, :, channels], variance[:, :, channels])
            mean, variance = (a.reshape(*rest.shape, -1) for a in (mean, variance))
            there = weight[:, :, None] > 0.0
            variance = np.where(there, variance, np.float32(1.0))
            limit = foreground_limit(variance, risk, weight=weight)
            means.append(np.where(there, mean, _NOWHERE))
            scales.append(1.0 / np.sqrt(variance * limit[:, :, None]))
        shape = (len(modes), *rest.shape) if self._grey else (len(modes), *background.mean.shape)
        return (
            np.ascontiguousarray(means, dtype=np.float32).reshape(shape),
            np.ascontiguousarray(scales, dtype=np.float32).reshape(shape),
        )

    def labels(self, image: Image) -> Mask:
        """(h, w) uint8: 0 background, 127 shadow, 255 foreground, before any repair.

        The array is overwritten by the next call.

        Raises:
            ImageError: not an image of the background's size and channels; names the camera.
        """
        check_image(image, self.camera, size_px=self.background.size_px)
        channels = 1 if image.ndim == 2 else 3
        if channels != self.background.channels:
            kind = {1: "grey", 3: "colour"}
            raise ImageError(
                f"{self.camera}: got a {kind[channels]} image, its background is "
                f"{kind[self.background.channels]}; expected the same"
            )
        if self._smooth:
            image = np.asarray(cv2.GaussianBlur(image, _SMOOTH_PX, 0.0), dtype=np.uint8)
        if self._grey:
            image, label = grey_of(image), kernels.label_grey
        else:
            label = kernels.label_colour
        if self.settings.exposure_compensation:
            by_channel = image.reshape(*self._labels.shape, -1)
            self._gain[:] = exposure_gain(by_channel, self._means_by_channel[0])
        label(image, self._mean, self._scale, self._gain, self._rule, self._labels)
        self._look_at_texture(image)
        return self._labels

    def _look_at_texture(self, image: Image) -> None:
        options = self.settings
        # A pixel that shows things by turns has no one pattern.
        if options.texture_radius_px == 0 or not options.shadow_removal or self.background.modes:
            return
        reveal = self._grey and options.texture_reveal
        if reveal:
            region = (0, 0, self._labels.shape[1], self._labels.shape[0])
        else:
            # Specks would stretch it over the whole image.
            solid = cv2.morphologyEx(self._labels, cv2.MORPH_OPEN, _SOLID)
            left, top, width, height = cv2.boundingRect(solid)
            region = (left, top, width, height)
        correct_labels(
            grey_of(image),
            self._grey_mean,
            float(self._gain.mean()),
            self._sigma,
            self._labels,
            region,
            radius=options.texture_radius_px,
            light=(options.texture_light_min, options.shadow_value_max + 0.03),
            protect=self._grey,
            reveal=reveal,
        )

    def mask(self, image: Image) -> Mask:
        """The silhouette (h, w) uint8, 0 or 255; overwritten by the next call."""
        foreground_mask(self.labels(image), self._mask, self._least_shadow_px, grey=self._grey)
        return clean_mask(self._mask, self.settings)

    def observe(self, image: Image, stamp_ns: int) -> Observation:
        """Silhouette and edge map of the whole frame.

        They depend on this image alone, unless `background_follow_s` lets the background follow
        slow changes: then on the images before as well, in the order of the calls.

        Args:
            image: (h, w, 3) BGR or (h, w) grey, uint8, of the background's size and channels.
            stamp_ns: capture time, goes into the observation.

        Raises:
            ImageError: another kind of image came; names the camera.
        """
        mask = self.mask(image)
        edges = edge_map(image, mask, self.settings)
        if self._adaptation is not None:
            values = (grey_of(image) if self._grey else image).reshape(*mask.shape, -1)
            self._adaptation.follow(
                values, mask, stamp_ns, self._gain, self._means_by_channel, self._scales_by_channel
            )
        return Observation.from_mask(self.camera, stamp_ns, mask, edges)
