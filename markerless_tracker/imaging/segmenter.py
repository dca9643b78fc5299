"""One camera's image to evidence: silhouette and edge map."""

import numpy as np

from markerless_tracker.errors import ImageError
from markerless_tracker.imaging import kernels
from markerless_tracker.imaging.background import BackgroundModel, foreground_limit
from markerless_tracker.imaging.edges import edge_map
from markerless_tracker.imaging.images import Image, check_image, grey_of
from markerless_tracker.imaging.morphology import Mask, clean_mask, foreground_mask
from markerless_tracker.imaging.settings import ImagingSettings
from markerless_tracker.imaging.shadow import shadow_rule
from markerless_tracker.records import Observation

# Largest difference of a background's channels, grey levels, that still is a grey camera's.
_GREY_TOLERANCE = 0.5


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
        mean, variance = background.mean, background.variance
        # Three equal channels are a grey camera's: one carries all there is to know.
        spread = mean.max(axis=2) - mean.min(axis=2)
        self._grey = background.channels == 1 or bool(spread.max() <= _GREY_TOLERANCE)
        if self._grey:
            mean, variance = mean[:, :, :1], variance[:, :, :1]
        limit = foreground_limit(variance, self.settings.background_risk)
        scale = 1.0 / np.sqrt(variance * limit[:, :, None])
        if self._grey:
            mean, scale = mean[:, :, 0], scale[:, :, 0]
        self._mean = np.ascontiguousarray(mean, dtype=np.float32)
        self._scale = np.ascontiguousarray(scale, dtype=np.float32)
        self._rule = shadow_rule(self.settings, grey=self._grey)
        self._labels = np.empty(self._mean.shape[:2], dtype=np.uint8)
        self._mask = np.empty_like(self._labels)
        options = self.settings
        share = options.shadow_grey_blob_share if self._grey else options.shadow_blob_share
        self._least_shadow_px = share * self._mask.size

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
        if self._grey:
            kernels.label_grey(grey_of(image), self._mean, self._scale, self._rule, self._labels)
        else:
            kernels.label_colour(image, self._mean, self._scale, self._rule, self._labels)
        return self._labels

    def mask(self, image: Image) -> Mask:
        """The silhouette (h, w) uint8, 0 or 255; overwritten by the next call."""
        foreground_mask(self.labels(image), self._mask, self._least_shadow_px, grey=self._grey)
        return clean_mask(self._mask, self.settings)

    def observe(self, image: Image, stamp_ns: int) -> Observation:
        """Silhouette and edge map of the whole frame.

        Args:
            image: (h, w, 3) BGR or (h, w) grey, uint8, of the background's size and channels.
            stamp_ns: capture time, goes into the observation.

        Raises:
            ImageError: another kind of image came; names the camera.
        """
        mask = self.mask(image)
        edges = edge_map(image, mask, self.settings)
        return Observation.from_mask(self.camera, stamp_ns, mask, edges)
