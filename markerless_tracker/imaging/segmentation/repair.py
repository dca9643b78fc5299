"""Makes a silhouette from labels: shadow patches, cracks, blobs, holes, border and contour."""

import cv2
import numpy as np

from markerless_tracker.imaging.images import Image
from markerless_tracker.imaging.masks import Mask
from markerless_tracker.imaging.region import Region
from markerless_tracker.imaging.segmentation.blobs import clear_small, fill_small, occupied
from markerless_tracker.imaging.segmentation.border import trim_border
from markerless_tracker.imaging.segmentation.kernels import WEAK
from markerless_tracker.imaging.segmentation.labels import PixelLabeller
from markerless_tracker.imaging.segmentation.level_set import refine_contour
from markerless_tracker.imaging.segmentation.morphology import (
    add_mixed_patches,
    fill_specks,
    open_and_close,
    shadow_patches,
)
from markerless_tracker.imaging.segmentation.zones import Zones
from markerless_tracker.imaging.settings import ImagingSettings

# Least difference of body and background, in standard deviations of the noise, to move a border.
_LEAST_CONTRAST = 5.0


def repair_mask(
    labels: Mask,
    mask: Mask,
    shadow: Mask,
    zones: Zones,
    settings: ImagingSettings,
    *,
    grey: bool,
    least_shadow_px: float,
) -> bool:
    """Fill a mask from labels; small shadow patches, blobs and holes are removed.

    With three classes the mask holds shadows, too.

    Args:
        labels: (h, w) uint8 of `zones.window`, from `labels.PixelLabeller`; with three classes
            `fill_specks` changes them.
        mask: (h, w) uint8, written: 0 or 255; correct only within `zones.zone`.
        shadow: (h, w) uint8, written: 0 or 255, patches of shadow.
        zones: the place of the labels in the image, and where the mask is needed.
        settings: the group `mask`.
        grey: whether the camera is a grey one.
        least_shadow_px: smaller patches of shadow become foreground.

    Returns:
        False if the size of a needed patch is unknown, as it may continue outside the zone.
    """
    frame_px, window = zones.frame_px, zones.window
    undecided = settings.shadow.undecided
    if undecided:
        fill_specks(labels)
    opened = undecided or (grey and least_shadow_px > 1.0)
    if shadow_patches(
        labels, shadow, least_shadow_px, opened=opened,
        zone=zones.zone_before_repair.relative_to(window),
        need=zones.patches_before_repair.relative_to(window), unknown=zones.open_sides,
    ):  # fmt: skip
        return False
    if undecided:
        add_mixed_patches(labels, shadow)
    # Weak pixels count in large patches only, since small ones are noise.
    cv2.threshold(labels, WEAK, 255, cv2.THRESH_BINARY, dst=mask)
    if undecided:
        cv2.bitwise_or(mask, shadow, dst=mask)
    else:
        cv2.subtract(mask, shadow, dst=mask)
    # The mask is wrong outside of `zone_before_repair`, where opening and closing do not depend on
    # it.
    open_and_close(mask, settings, frame_px)
    zone, need = zones.zone.relative_to(window), zones.patches.relative_to(window)
    unknown = zones.open_sides
    least, largest = settings.mask.blob_share * frame_px, settings.mask.hole_share * frame_px
    if clear_small(mask, least, connectivity=8, zone=zone, need=need, unknown=unknown):
        return False
    return not fill_small(mask, largest, zone=zone, need=need, unknown=unknown)


def fit_border(
    image: Image, mask: Mask, zones: Zones, labeller: PixelLabeller, settings: ImagingSettings
) -> None:
    """Move a mask's border to the body's border, in place.

    Args:
        image: the whole image.
        mask: (h, w) uint8 of `zones.window`, 0 or 255; correct within `zones.zone`.
        zones: as in `repair_mask`.
        labeller: the labeller of this image.
        settings: `mask.trim_px` and the group `level_set`.
    """
    zone = zones.zone.relative_to(zones.window)
    _trim(mask, zone, zones.window, labeller, settings.mask.trim_px)
    _refine(image, mask, zone, zones.window, labeller, settings)


def _trim(mask: Mask, zone: Region, window: Region, labeller: PixelLabeller, layers: int) -> None:
    """Clear pixels of the mask's border that the body covers by less than half, in place."""
    body = occupied(mask, zone)
    if layers == 0 or body.width <= 0:
        return
    # Grown by a pixel, so that the body ends inside the box, except at the image's border.
    box = body.grown(1, (mask.shape[1], mask.shape[0]))
    part = np.ascontiguousarray(mask[box.slices])
    place = box.moved(window.left, window.top)
    trim_border(
        labeller.planes, (box.left, box.top), labeller.means, labeller.gain, part, place,
        layers=layers, least=_LEAST_CONTRAST * labeller.background.sigma,
    )  # fmt: skip
    mask[box.slices] = part


def _refine(
    image: Image,
    mask: Mask,
    zone: Region,
    window: Region,
    labeller: PixelLabeller,
    settings: ImagingSettings,
) -> None:
    """Move the mask's contour inside the zone to the local contrast, in place."""
    if settings.level_set.iterations == 0:
        return
    body = occupied(mask, zone)
    if body.width <= 0:
        return
    margin = settings.level_set.iterations + settings.level_set.radius_px
    box = body.grown(margin, (mask.shape[1], mask.shape[0]))
    part = np.ascontiguousarray(mask[box.slices])
    refine_contour(
        labeller.background.pixels(image, box.moved(window.left, window.top)),
        part,
        iterations=settings.level_set.iterations,
        radius_px=settings.level_set.radius_px,
        least=_LEAST_CONTRAST * labeller.background.sigma,
    )
    mask[box.slices] = part
