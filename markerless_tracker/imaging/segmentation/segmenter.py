"""Makes evidence of one camera's images: silhouette and edge map."""

import threading

import numpy as np

from markerless_tracker.errors import ImageError
from markerless_tracker.imaging.background.model import BackgroundModel
from markerless_tracker.imaging.edges import edge_map, edge_radius_px
from markerless_tracker.imaging.images import Image, check_image
from markerless_tracker.imaging.masks import Mask
from markerless_tracker.imaging.region import Region
from markerless_tracker.imaging.segmentation.labels import PixelLabeller
from markerless_tracker.imaging.segmentation.morphology import split_undecided
from markerless_tracker.imaging.segmentation.repair import fit_border, repair_mask
from markerless_tracker.imaging.segmentation.zones import Zones
from markerless_tracker.imaging.settings import ImagingSettings
from markerless_tracker.observation import Observation, no_edges

# Least margin beyond the needed region that is labelled, for patches that continue there.
_SLACK_PX = 8
# The margin that an image needed is tried first in so many images after it.
_TRIED_AGAIN = 8


class Segmenter:
    """Finds the person in one camera's images.

    Its scratch images are reused, so `observe` and `labels` of one segmenter wait for each other.
    The segmenters of different cameras may run in parallel, since the kernels and OpenCV release
    the interpreter's lock.

    Args:
        camera: the camera's name.
        background: its empty scene.
        settings: defaults if None.
        edges: whether edge maps are used; if not, those of observations are 0.

    Attributes:
        lock: held while an image is segmented; hold it to read the `gain` of that image.

    Raises:
        ImageError: no background for this camera.
    """

    def __init__(
        self,
        camera: str,
        background: BackgroundModel | None,
        settings: ImagingSettings | None = None,
        *,
        edges: bool = True,
    ) -> None:
        if background is None:
            raise ImageError(f"{camera}: no background came, expected one to compare images with")
        self.camera = camera
        self.background = background
        self.settings = settings or ImagingSettings()
        self._with_edges = edges
        self.lock = threading.RLock()
        self._labeller = PixelLabeller(camera, background, self.settings)
        self._grey = self._labeller.background.is_grey
        self._size_px = width, height = background.size_px
        self._whole = Region.whole(self._size_px)
        self._memory = np.empty((2, height * width), dtype=np.uint8)
        options = self.settings
        share = options.shadow.grey_blob_share if self._grey else options.shadow.blob_share
        self._least_shadow_px = share * height * width
        self._slack_px, self._tries = _SLACK_PX, 0

    @property
    def gain(self) -> tuple[float, ...]:
        """Brightness of the last image relative to the background's, by channel."""
        return tuple(float(value) for value in self._labeller.gain)

    def warm_up(self) -> None:
        """Compile the segmentation; then `reset`."""
        width, height = self._size_px
        channels = self.background.channels
        shape = (height, width) if channels == 1 else (height, width, channels)
        # A background follows from the second image on.
        for stamp_ns in (0, 1):
            self.observe(np.zeros(shape, dtype=np.uint8), stamp_ns)
        self.reset()

    def reset(self) -> None:
        """Return to the initial background."""
        self._labeller.reset()

    def mask(self, image: Image, region: Region | None = None) -> Mask:
        """The silhouette (h, w) uint8, 0 or 255, of a region or the whole frame.

        The array is overwritten by the next call.

        Raises:
            ImageError: as `observe`.
        """
        return self.classes(image, region)[0]

    def classes(self, image: Image, region: Region | None = None) -> tuple[Mask, Mask | None]:
        """As `mask`, and a mask of the undecided pixels; None with two classes.

        Raises:
            ImageError: as `observe`.
        """
        region = self._checked(image, region)
        with self.lock:
            mask, undecided, zone = self._silhouette(image, region, 0)
        inside = region.relative_to(zone).slices
        return mask[inside], None if undecided is None else undecided[inside]

    def labels(self, image: Image) -> Mask:
        """(h, w) uint8 before any repair, for display.

        0 background, 64 weak, 127 shadow, 255 foreground, as of `labels.PixelLabeller`.

        Raises:
            ImageError: not an image of the background's size and channels; names the camera.
        """
        self.check(image)
        with self.lock:
            self._labeller.measure_exposure(image)
            return self._labeller.label(image, self._whole, self._whole).copy()

    def observe(self, image: Image, stamp_ns: int, region: Region | None = None) -> Observation:
        """Silhouette and edge map of a region, or of the whole frame.

        They depend on this image only, unless `background.follow_s` lets the background follow slow
        changes; then they depend on earlier images, too, in the order of the calls. Inside a region
        they equal those of the whole frame.

        Args:
            image: (h, w, 3) BGR or (h, w) grey, uint8, of the background's size and channels.
            stamp_ns: capture time, goes into the observation.
            region: the part of the image to segment; None = the whole image. The background follows
                only images that are segmented whole.

        Raises:
            ImageError: another size or other channels, or a region outside; names the camera.
        """
        region = self._checked(image, region)
        with self.lock:
            return self._observe(image, stamp_ns, region)

    def _observe(self, image: Image, stamp_ns: int, region: Region) -> Observation:
        radius_px = edge_radius_px(self.settings) if self._with_edges else 0
        mask, undecided, zone = self._silhouette(image, region, radius_px)
        inside = region.relative_to(zone).slices
        either = mask if undecided is None else mask | undecided
        if self._with_edges:
            edges = edge_map(image[zone.slices], either, self.settings)[inside]
        else:
            edges = no_edges((region.height, region.width))
        self._labeller.follow(image, either if region == self._whole else None, stamp_ns)
        return Observation.from_mask(
            self.camera,
            stamp_ns,
            mask[inside],
            edges,
            undecided=None if undecided is None else undecided[inside],
            size_px=self._size_px,
            offset_px=(region.left, region.top),
        )

    def _checked(self, image: Image, region: Region | None) -> Region:
        """The region to segment, by default the whole image; raises as `observe`."""
        self.check(image)
        region = region or self._whole
        if region.width <= 0 or region.height <= 0 or region.grown(0, self._size_px) != region:
            raise ImageError(
                f"{self.camera}: got a region of {tuple(region)}, expected one inside the image of "
                f"{self._size_px[0]}x{self._size_px[1]} px"
            )
        return region

    def check(self, image: Image) -> None:
        """Check that an image has the background's size and channels.

        Raises:
            ImageError: it has not; names the camera.
        """
        check_image(image, self.camera, size_px=self._size_px)
        channels = 1 if image.ndim == 2 else 3
        if channels != self.background.channels:
            kind = {1: "grey", 3: "colour"}
            raise ImageError(
                f"{self.camera}: got a {kind[channels]} image, its background is "
                f"{kind[self.background.channels]}; expected the same"
            )

    def _silhouette(
        self, image: Image, region: Region, radius_px: int
    ) -> tuple[Mask, Mask | None, Region]:
        """Person and undecided of a zone that contains the region and `radius_px` px around it.

        Decisions by the size of a patch need the whole patch, so the margin is increased until the
        sizes of all needed patches are known. A larger margin than needed changes nothing.
        """
        self._labeller.measure_exposure(image)
        need = region.grown(radius_px, self._size_px)
        self._tries -= 1
        slack = self._slack_px if self._tries >= 0 else _SLACK_PX
        while True:
            found = self._try_silhouette(image, need, slack)
            if found is not None:
                return found
            slack *= 4
            self._slack_px, self._tries = slack, _TRIED_AGAIN

    def _try_silhouette(
        self, image: Image, need: Region, slack: int
    ) -> tuple[Mask, Mask | None, Region] | None:
        """As `_silhouette`, with a margin of `slack` px; None if that is too small."""
        zones = Zones.around(need, slack, self._size_px, self.settings, grey=self._grey)
        window = zones.window
        labels = self._labeller.label(image, window, zones.corrected)
        size = window.height * window.width
        mask, shadow = self._memory[:, :size].reshape(2, window.height, window.width)
        if not repair_mask(
            labels, mask, shadow, zones, self.settings, grey=self._grey,
            least_shadow_px=self._least_shadow_px,
        ):  # fmt: skip
            return None
        fit_border(image, mask, zones, self._labeller, self.settings)
        inside = zones.zone.relative_to(window).slices
        if not self.settings.shadow.undecided:
            return mask[inside], None, zones.zone
        split_undecided(mask, shadow)
        return mask[inside], shadow[inside], zones.zone
