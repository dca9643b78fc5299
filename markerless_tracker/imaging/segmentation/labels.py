"""Label of each pixel of an image: background, weak, background in shadow, or foreground."""

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from markerless_tracker.imaging.background.adapt import Adaptation
from markerless_tracker.imaging.background.model import BackgroundModel
from markerless_tracker.imaging.images import FloatImage, Image
from markerless_tracker.imaging.masks import SOLID, Mask
from markerless_tracker.imaging.region import Region
from markerless_tracker.imaging.segmentation import kernels
from markerless_tracker.imaging.segmentation.blobs import occupied
from markerless_tracker.imaging.segmentation.exposure import ExposureMeter
from markerless_tracker.imaging.segmentation.gaussians import BackgroundGaussians
from markerless_tracker.imaging.segmentation.morphology import FULL_FRAME_PX
from markerless_tracker.imaging.segmentation.patches import mark_weak
from markerless_tracker.imaging.segmentation.shadow import (
    NOISE,
    PATCH_RADIUS_PX,
    SIDE_PX,
    compares_patches,
    even_patches,
    inverse_means,
    label_by_patch,
    near_even,
    patch_means,
    shadow_rule,
)
from markerless_tracker.imaging.segmentation.texture import correct_labels, correction_radius_px
from markerless_tracker.imaging.settings import ImagingSettings

WEAK_RADIUS_PX = 3
"""Radius of the patches whose mean is compared with the background."""
_LEAST_SHARE = 0.5
EXAMINED_RADIUS_PX = 3
"""Radius of the labels that decide whether a pixel's texture is examined."""


def patch_radius_px(settings: ImagingSettings) -> int:
    """Radius of the labels that a label depends on through the means of patches, px."""
    compares = settings.shadow.undecided and settings.shadow.weak_sigmas > 0.0
    return WEAK_RADIUS_PX if compares else 0


class PixelLabeller:
    """Labels pixels of one camera's images: 0 background, 64 weak, 127 shadow, 255 foreground.

    A pixel's label depends on colours near it, not on the size or shape of patches.

    Args:
        camera: the camera's name.
        background: its empty scene.
        settings: of the foreground, shadow and texture tests.

    Attributes:
        background: the Gaussians; with `background.follow_s`, `mean` follows slow changes.
        gain: (c,) float32, brightness of the last image relative to the background's.
        planes: (c, a, b) uint8, the channels of the window that was labelled last.
    """

    def __init__(self, camera: str, background: BackgroundModel, settings: ImagingSettings) -> None:
        self.background = BackgroundGaussians(camera, background, settings)
        self._settings = settings
        gaussians = self.background
        self._first = kernels.coarse(gaussians.mean[0], gaussians.scale[0])
        # A view of the same memory.
        self._means_channels_last = gaussians.mean.transpose(0, 2, 3, 1)
        self._scales_channels_last = gaussians.scale.transpose(0, 2, 3, 1)
        self.gain: NDArray[np.float32] = np.ones(gaussians.mean.shape[1], dtype=np.float32)
        self._meter = ExposureMeter(self._means_channels_last[0])
        self._adaptation = (
            Adaptation(settings.background.follow_s, settings.background.follow_margin_px)
            if settings.background.follow_s > 0.0
            else None
        )
        self._rule = shadow_rule(settings, grey=gaussians.is_grey)
        self._patches = self._patches_of_background()
        # A pixel that alternates between several appearances has no single pattern.
        self._uses_texture = (
            settings.texture.radius_px > 0 and settings.shadow.removal and not background.modes
        )
        # A single still does not show its noise, and has errors that patches do not average out.
        # A slow change of light, which the background follows, would look like a faint patch.
        self._uses_patches = (
            patch_radius_px(settings) > 0
            and background.variance.min() < background.variance.max()
            and self._adaptation is None
            and not background.modes
        )
        width, height = gaussians.size_px
        # Limbs are smaller in smaller images; patches must not be wider than limbs.
        scale = min(1.0, math.sqrt(width * height / FULL_FRAME_PX))
        self._patch_radius_px = max(1, round(WEAK_RADIUS_PX * scale))
        self._memory = np.empty(height * width, dtype=np.uint8)
        self._channels = np.empty(0 if gaussians.is_grey else 3 * height * width, dtype=np.uint8)
        self.planes = self._channels[:0].reshape(self.gain.size, 0, 0)

    def _patches_of_background(self) -> FloatImage | None:
        """The background for `even_patches`; None if the colours of patches are not compared.

        A pixel that alternates between several appearances has no single colour.
        """
        means = self.background.mean
        if len(means) > 1 or not compares_patches(self._settings, grey=self.background.is_grey):
            return None
        return inverse_means(means[0])

    @property
    def means(self) -> NDArray[np.uint16]:
        """(c, h, w) means of the first Gaussians, in steps of 1 / `kernels.LEVELS` grey level."""
        means: NDArray[np.uint16] = self._first[0][0]
        return means

    def reset(self) -> None:
        """Return to the initial background."""
        if self._adaptation is not None:
            self._adaptation.reset()
            self.background.reset()
            self._first = kernels.coarse(self.background.mean[0], self.background.scale[0])
            self._patches = self._patches_of_background()
        self.gain[:] = 1.0

    def measure_exposure(self, image: Image) -> None:
        """Set `gain` from a whole image (h, w) or (h, w, 3), if the settings require it."""
        if self._settings.background.exposure_compensation:
            values = self._whole(image) if self.background.smooths else image
            self.gain[:] = self._meter.gain(values.reshape(*values.shape[:2], -1))

    def _whole(self, image: Image) -> Image:
        """A whole image as it is compared with the background, (h, w, c)."""
        return self.background.pixels(image, Region.whole(self.background.size_px))

    def label(self, image: Image, window: Region, corrected: Region) -> Mask:
        """Labels (h, w) uint8 of a window of the image; overwritten by the next call.

        Args:
            image: the whole image.
            window: the labelled region.
            corrected: the part of the window in which texture corrects labels.
        """
        count = window.width * window.height
        labels = self._memory[:count].reshape(window.height, window.width)
        self.planes = planes = self.background.planes(image, window, self._channels)
        known = (
            *self._first, self.background.mean, self.background.scale, self.gain, self._rule,
            window.left, window.top, *kernels.make_row(window.width),
        )  # fmt: skip
        if self.background.is_grey:
            kernels.label_grey(planes[0], *known, labels)
        else:
            kernels.label_colour(planes, *known, labels)
            self._compare_patches(planes, labels, window)
        if self._uses_texture:
            self._correct_by_texture(image, labels, window, corrected)
        if self._uses_patches:
            self._mark_weak(planes, labels, window)
        return labels

    def _compare_patches(self, planes: NDArray[np.uint8], labels: Mask, window: Region) -> None:
        """Decide between shadow and foreground by the colours of patches, in place.

        Args:
            planes: (3, h, w) the channels of the window.
            labels: (h, w).
            window: its place in the image.
        """
        size_px = (window.width, window.height)
        box = occupied(labels, Region.whole(size_px))
        if self._patches is None or box.width <= 0:
            return
        # The box includes the patches of its pixels.
        rows, columns = box.grown(PATCH_RADIUS_PX, size_px).slices
        corner = (window.left + columns.start, window.top + rows.start)
        means = patch_means(planes[:, rows, columns])
        found = np.ascontiguousarray(labels[rows, columns])
        spread = np.float32(self._settings.shadow.spread_max)
        noise = np.float32(NOISE * self.background.sigma / SIDE_PX)
        even = np.empty_like(found)
        even_patches(means, self._patches, self.gain, spread, noise, *corner, found, even)
        label_by_patch(
            planes, columns.start, rows.start, self._first[0], self.gain, self._rule,
            near_even(even), even, *corner, found,
        )  # fmt: skip
        labels[rows, columns] = found

    def _mark_weak(self, planes: NDArray[np.uint8], labels: Mask, window: Region) -> None:
        """Label background as weak where a patch differs from it, though no single pixel does."""
        options = self._settings.shadow
        limit = max(options.weak_least, options.weak_sigmas * self.background.sigma)
        # Pixels that differ by themselves would affect the patches beside them.
        mark_weak(
            planes, self._first[0][0], self.gain, labels, (window.left, window.top),
            radius=self._patch_radius_px, limit=limit, least_share=_LEAST_SHARE,
        )  # fmt: skip

    def _correct_by_texture(
        self, image: Image, labels: Mask, window: Region, corrected: Region
    ) -> None:
        """Correct the labels (h, w) of a window inside `corrected`, in place."""
        options, is_grey = self._settings, self.background.is_grey
        part, examined = window, labels
        if not is_grey:
            # Specks are removed later, so their texture is not tested.
            solid = cv2.threshold(labels, kernels.SHADOW, 255, cv2.THRESH_BINARY)[1]
            cv2.morphologyEx(solid, cv2.MORPH_OPEN, SOLID, dst=solid)
            examined = np.asarray(cv2.dilate(solid, SOLID), dtype=np.uint8)
            part = occupied(examined, corrected.relative_to(window)).moved(window.left, window.top)
        if part.width <= 0:
            return
        seen = part.grown(correction_radius_px(options.texture.radius_px), self.background.size_px)
        correct_labels(
            self.background.grey(image, seen),
            self.background.grey_mean,
            float(self.gain.mean()),
            self.background.sigma,
            labels,
            window,
            part,
            seen,
            examined=examined,
            radius=options.texture.radius_px,
            light=(options.texture.light_min, options.shadow.value_max + 0.03),
            protect=is_grey,
            reveal=is_grey and options.texture.reveal,
        )

    def follow(self, image: Image, mask: Mask | None, stamp_ns: int) -> None:
        """Let the background follow an image, if the settings require it.

        Args:
            image: the whole image.
            mask: (h, w) its silhouette; None if only a part was segmented, from which nothing is
                learned.
            stamp_ns: capture time.
        """
        if self._adaptation is None:
            return
        if mask is None:
            self._adaptation.pass_over(stamp_ns)
            return
        self._adaptation.follow(
            self._whole(image), mask, stamp_ns, self.gain,
            self._means_channels_last, self._scales_channels_last,
        )  # fmt: skip
        self.background.grey_changed()
        self._first = kernels.coarse(self.background.mean[0], self.background.scale[0])
        self._patches = self._patches_of_background()
