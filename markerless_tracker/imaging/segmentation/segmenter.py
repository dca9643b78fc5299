"""One camera's image to evidence: silhouette and edge map."""

import cv2
import numpy as np

from markerless_tracker.errors import ImageError
from markerless_tracker.imaging.background.adapt import Adaptation
from markerless_tracker.imaging.background.model import (
    BackgroundModel,
    FloatImage,
    foreground_limit,
    risk_of,
)
from markerless_tracker.imaging.edges import edge_map, edge_reach
from markerless_tracker.imaging.images import Image, check_image, grey_of
from markerless_tracker.imaging.region import Region
from markerless_tracker.imaging.segmentation import kernels
from markerless_tracker.imaging.segmentation.blobs import (
    BOTTOM,
    LEFT,
    RIGHT,
    TOP,
    clear_small,
    fill_small,
    occupied,
)
from markerless_tracker.imaging.segmentation.border import border_reach, trim_border
from markerless_tracker.imaging.segmentation.exposure import ExposureMeter
from markerless_tracker.imaging.segmentation.level_set import level_set_reach, refine_contour
from markerless_tracker.imaging.segmentation.morphology import (
    Mask,
    foreground_mask,
    open_and_close,
    patch_reach,
    repair_reach,
)
from markerless_tracker.imaging.segmentation.shadow import shadow_rule
from markerless_tracker.imaging.segmentation.texture import correct_labels, texture_reach
from markerless_tracker.imaging.settings import ImagingSettings
from markerless_tracker.records import Observation

# Largest difference of a background's channels, grey levels, that still is a grey camera's.
_GREY_TOLERANCE = 0.5
_LUMA = np.array([0.114, 0.587, 0.299], dtype=np.float32)
# Window of the Gaussian blur that noisy images get.
_SMOOTH_PX = (5, 5)
_SOLID = np.ones((3, 3), dtype=np.uint8)
# How far the choice of pixels whose texture is looked at reaches.
_LOOK_PX = 3
# How much more than needed is looked at, at first, for patches that go on there.
_SLACK_PX = 8
# Difference of body and background, in deviations of the noise, from which on their mixture tells.
_LEAST_CONTRAST = 5.0
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
        self._smooth = sigma > self.settings.background.denoise_sigma
        self._mean, self._scale = self._gaussians()
        self._first = kernels.coarse(self._mean[0], self._scale[0])
        mean, variance = self._steady(background.mean, background.variance)
        if self._grey:
            self._grey_mean = np.ascontiguousarray(mean[:, :, 0])
            self._sigma = float(np.sqrt(np.median(variance[:, :, 0])))
        else:
            self._grey_mean = np.ascontiguousarray(mean @ _LUMA, dtype=np.float32)
            self._sigma = float(np.sqrt(np.median(variance @ _LUMA**2)))
        width, height = background.size_px
        # The same memory with channels last.
        self._means_by_channel = self._mean.transpose(0, 2, 3, 1)
        self._scales_by_channel = self._scale.transpose(0, 2, 3, 1)
        self._gain = np.ones(self._mean.shape[1], dtype=np.float32)
        self._meter = ExposureMeter(self._means_by_channel[0])
        options = self.settings
        self._adaptation = (
            Adaptation(options.background.follow_s, options.background.follow_margin_px)
            if options.background.follow_s > 0.0
            else None
        )
        self._rule = shadow_rule(self.settings, grey=self._grey)
        self._size_px = (width, height)
        self._whole = Region.whole(self._size_px)
        self._memory = np.empty((2, height * width), dtype=np.uint8)
        share = options.shadow.grey_blob_share if self._grey else options.shadow.blob_share
        self._least_shadow_px = share * height * width

    @property
    def gain(self) -> tuple[float, ...]:
        """Brightness of the last image relative to the background's, by channel."""
        return tuple(float(value) for value in self._gain)

    def reset(self) -> None:
        """Back to the background that was given; what was learned since is forgotten."""
        if self._adaptation is not None:
            self._adaptation.reset()
            self._mean[...] = self._gaussians()[0]
            self._first = kernels.coarse(self._mean[0], self._scale[0])
        self._gain[:] = 1.0

    def _steady(self, mean: FloatImage, variance: FloatImage) -> tuple[FloatImage, FloatImage]:
        """Mean and variance (h, w, c) of images as they are compared: smoothed if too noisy."""
        if not self._smooth:
            return mean, variance
        smooth = np.asarray(cv2.GaussianBlur(mean, _SMOOTH_PX, 0.0), dtype=np.float32)
        row = cv2.getGaussianKernel(_SMOOTH_PX[0], 0.0, cv2.CV_64F)
        less = np.maximum(
            variance * float((row**2).sum() ** 2), self.settings.background.sigma_min**2
        )
        return smooth.reshape(mean.shape), less.astype(np.float32)

    def _gaussians(self) -> tuple[FloatImage, FloatImage]:
        """Means and 1 / (sigma sqrt(limit)) of all modes, (k, c, h, w) each."""
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
        return _planar(means), _planar(scales)

    def mask(self, image: Image, region: Region | None = None) -> Mask:
        """The silhouette (h, w) uint8, 0 or 255, of a region or the whole frame.

        The array is overwritten by the next call.

        Raises:
            ImageError: not an image of the background's size and channels; names the camera.
        """
        self._check(image)
        region = region or self._whole
        mask, zone = self._silhouette(image, region, 0)
        return mask[region.within(zone).slices]

    def labels(self, image: Image) -> Mask:
        """(h, w) uint8: 0 background, 127 shadow, 255 foreground, before any repair; to look at.

        Raises:
            ImageError: not an image of the background's size and channels; names the camera.
        """
        self._check(image)
        if self.settings.background.exposure_compensation:
            self._gain[:] = self._meter.gain(image.reshape(image.shape[0], image.shape[1], -1))
        labels = self._labels(image, self._whole)
        self._look_at_texture(image, labels, self._whole, self._whole)
        return labels.copy()

    def observe(self, image: Image, stamp_ns: int, region: Region | None = None) -> Observation:
        """Silhouette and edge map of a region, or of the whole frame.

        They depend on this image alone, unless `background.follow_s` lets the background follow
        slow changes: then on the images before as well, in the order of the calls. Inside a region
        they are what they would be in the whole frame.

        Args:
            image: (h, w, 3) BGR or (h, w) grey, uint8, of the background's size and channels.
            stamp_ns: capture time, goes into the observation.
            region: the part of the image to work in; all of it if None. The background follows
                only where the whole frame is looked at.

        Raises:
            ImageError: another kind of image came, or a region outside it; names the camera.
        """
        self._check(image)
        region = region or self._whole
        if region.width <= 0 or region.height <= 0 or region.grown(0, self._size_px) != region:
            raise ImageError(
                f"{self.camera}: got a region of {tuple(region)}, expected one inside the image of "
                f"{self._size_px[0]}x{self._size_px[1]} px"
            )
        mask, zone = self._silhouette(image, region, edge_reach(self.settings))
        inside = region.within(zone).slices
        edges = edge_map(image[zone.slices], mask, self.settings)[inside]
        if self._adaptation is not None and region != self._whole:
            self._adaptation.pass_over(stamp_ns)
        elif self._adaptation is not None:
            values = (grey_of(image) if self._grey else image).reshape(*mask.shape, -1)
            self._adaptation.follow(
                values, mask, stamp_ns, self._gain, self._means_by_channel, self._scales_by_channel
            )
            self._first = kernels.coarse(self._mean[0], self._scale[0])
        return Observation.from_mask(
            self.camera,
            stamp_ns,
            mask[inside],
            edges,
            size_px=self._size_px,
            offset_px=(region.left, region.top),
        )

    def _check(self, image: Image) -> None:
        check_image(image, self.camera, size_px=self._size_px)
        channels = 1 if image.ndim == 2 else 3
        if channels != self.background.channels:
            kind = {1: "grey", 3: "colour"}
            raise ImageError(
                f"{self.camera}: got a {kind[channels]} image, its background is "
                f"{kind[self.background.channels]}; expected the same"
            )

    def _silhouette(self, image: Image, region: Region, reach: int) -> tuple[Mask, Region]:
        """Mask of a zone that holds the region and `reach` px around it, and that zone.

        What is decided by the size of a patch needs all of the patch: more is looked at until none
        that is too small to tell goes on outside.
        """
        if self.settings.background.exposure_compensation:
            by_channel = image.reshape(image.shape[0], image.shape[1], -1)
            self._gain[:] = self._meter.gain(by_channel)
        slack = _SLACK_PX
        while True:
            found = self._try_silhouette(image, region.grown(reach, self._size_px), slack)
            if found is not None:
                return found
            slack *= 4

    def _try_silhouette(self, image: Image, need: Region, slack: int) -> tuple[Mask, Region] | None:
        """`_silhouette` with so much more around what is needed; None if that is too little."""
        size_px, options = self._size_px, self.settings
        if options.level_set.iterations:
            reach = level_set_reach(options.level_set.iterations, options.level_set.radius_px)
            need = need.grown(reach, size_px)
        whole = need.grown(border_reach(options.mask.trim_px), size_px)
        zone = whole.grown(slack, size_px)
        unknown = _open_sides(zone, size_px)
        frame_px = size_px[0] * size_px[1]
        repair = repair_reach(options, frame_px)
        patches = zone.grown(repair, size_px)
        window = patches.grown(_LOOK_PX + patch_reach(options, grey=self._grey), size_px)
        labels = self._labels(image, window)
        self._look_at_texture(image, labels, window, patches)
        mask = self._scratch(1, window)
        asked = foreground_mask(
            labels, mask, self._least_shadow_px, grey=self._grey, zone=patches.within(window),
            need=whole.grown(repair, size_px).within(window), unknown=unknown,
        )  # fmt: skip
        if asked:
            return None
        # Outside of `patches` the mask is wrong, but opening and closing reach no further.
        open_and_close(mask, options, frame_px)
        inner = zone.within(window)
        wanted = whole.within(window)
        least, largest = options.mask.blob_share * frame_px, options.mask.hole_share * frame_px
        if clear_small(mask, least, connectivity=8, zone=inner, need=wanted, unknown=unknown):
            return None
        if fill_small(mask, largest, zone=inner, need=wanted, unknown=unknown):
            return None
        self._trim(image, mask, inner, window)
        self._refine(image, mask, inner, window)
        return mask[inner.slices], zone

    def _trim(self, image: Image, mask: Mask, inner: Region, window: Region) -> None:
        """Take what the body covers by less than half from the mask's border, in place."""
        layers = self.settings.mask.trim_px
        body = occupied(mask, inner)
        if layers == 0 or body.width <= 0:
            return
        # One pixel more, so that the body ends inside; but it goes on beyond the image.
        box = body.grown(1, (mask.shape[1], mask.shape[0]))
        part = np.ascontiguousarray(mask[box.slices])
        place = box.moved(window.left, window.top)
        trim_border(
            self._pixels(image, place), self._mean[0], self._gain, part, place, layers=layers,
            least=_LEAST_CONTRAST * self._sigma,
        )  # fmt: skip
        mask[box.slices] = part

    def _refine(self, image: Image, mask: Mask, inner: Region, window: Region) -> None:
        """Move the mask's contour to the local contrast, in place; outside `inner` it is not."""
        options = self.settings
        body = occupied(mask, inner)
        if options.level_set.iterations == 0 or body.width <= 0:
            return
        margin = options.level_set.iterations + options.level_set.radius_px
        box = body.grown(margin, (mask.shape[1], mask.shape[0]))
        part = np.ascontiguousarray(mask[box.slices])
        refine_contour(
            self._pixels(image, box.moved(window.left, window.top)),
            part,
            iterations=options.level_set.iterations,
            radius_px=options.level_set.radius_px,
            least=_LEAST_CONTRAST * self._sigma,
        )
        mask[box.slices] = part

    def _pixels(self, image: Image, region: Region) -> Image:
        """(h, w, c) of a region as it is compared: smoothed if too noisy, one channel if grey."""
        wide = region.grown(_SMOOTH_PX[0] // 2 if self._smooth else 0, self._size_px)
        part = image[wide.slices]
        if self._smooth:
            part = np.asarray(cv2.GaussianBlur(part, _SMOOTH_PX, 0.0), dtype=np.uint8)
            part = part[region.within(wide).slices]
        part = np.ascontiguousarray(part)
        if self._grey:
            part = grey_of(part)
        return part.reshape(region.height, region.width, -1)

    def _labels(self, image: Image, window: Region) -> Mask:
        """0 background, 127 shadow, 255 foreground of a window, before any repair."""
        part = self._pixels(image, window)
        labels = self._scratch(0, window)
        label = kernels.label_grey if self._grey else kernels.label_colour
        label(
            part[:, :, 0] if self._grey else part, *self._first, self._mean, self._scale,
            self._gain, self._rule, window.left, window.top, labels,
        )  # fmt: skip
        return labels

    def _look_at_texture(self, image: Image, labels: Mask, window: Region, patches: Region) -> None:
        options = self.settings
        # A pixel that shows things by turns has no one pattern.
        if options.texture.radius_px == 0 or not options.shadow.removal or self.background.modes:
            return
        part, looked_at = window, labels
        if not self._grey:
            # Specks are not worth the look.
            solid = cv2.threshold(labels, kernels.SHADOW, 255, cv2.THRESH_BINARY)[1]
            cv2.morphologyEx(solid, cv2.MORPH_OPEN, _SOLID, dst=solid)
            looked_at = np.asarray(cv2.dilate(solid, _SOLID), dtype=np.uint8)
            part = occupied(looked_at, patches.within(window)).moved(window.left, window.top)
        if part.width <= 0:
            return
        seen = part.grown(texture_reach(options.texture.radius_px), self._size_px)
        correct_labels(
            grey_of(self._pixels(image, seen)),
            self._grey_mean,
            float(self._gain.mean()),
            self._sigma,
            labels,
            window,
            part,
            seen,
            looked_at=looked_at,
            radius=options.texture.radius_px,
            light=(options.texture.light_min, options.shadow.value_max + 0.03),
            protect=self._grey,
            reveal=self._grey and options.texture.reveal,
        )

    def _scratch(self, which: int, window: Region) -> Mask:
        count = window.width * window.height
        return self._memory[which, :count].reshape(window.height, window.width)


def _planar(images: list[FloatImage]) -> FloatImage:
    """Images (h, w, c) as one array (k, c, h, w)."""
    return np.ascontiguousarray(np.moveaxis(np.stack(images), -1, 1), dtype=np.float32)


def _open_sides(zone: Region, size_px: tuple[int, int]) -> int:
    """Sides of a zone beyond which the image goes on."""
    return (
        LEFT * (zone.left > 0)
        | TOP * (zone.top > 0)
        | RIGHT * (zone.right < size_px[0])
        | BOTTOM * (zone.bottom < size_px[1])
    )
