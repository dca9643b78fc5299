"""Morphology of silhouettes: specks, cracks, holes and blobs."""

import math

import cv2
import numpy as np

from markerless_tracker.imaging.masks import SOLID, Mask, disc
from markerless_tracker.imaging.region import Region
from markerless_tracker.imaging.segmentation.blobs import clear_small, fill_small
from markerless_tracker.imaging.segmentation.kernels import SHADOW, WEAK
from markerless_tracker.imaging.settings import ImagingSettings

# In images of at least this size, lengths in pixels are used unscaled.
FULL_FRAME_PX = 640 * 480
_WIDE = np.ones((5, 5), dtype=np.uint8)
"""Least width of a patch in which weak pixels mix with others, and of solid foreground."""
_SOLID_RADIUS_PX, _WIDE_RADIUS_PX = 2, 4
"""Radii of the pixels that an opening or closing by `SOLID` and by `_WIDE` depends on."""


def opening_radius_px(settings: ImagingSettings, *, grey: bool) -> int:
    """Radius of the labels that patches depend on, px, besides the size of patches.

    The patches are those of `shadow_patches`, `fill_specks` and `add_mixed_patches`.
    """
    if settings.shadow.undecided:
        return _SOLID_RADIUS_PX + 2 * _WIDE_RADIUS_PX
    return _SOLID_RADIUS_PX if grey else 0


def shadow_patches(
    labels: Mask,
    shadow: Mask,
    least_px: float,
    *,
    opened: bool,
    zone: Region | None = None,
    need: Region | None = None,
    unknown: int = 0,
) -> bool:
    """Find the patches of pixels labelled shadow or weak that are large enough.

    Args:
        labels: (h, w) uint8, as of `labels.PixelLabeller`.
        shadow: (h, w) uint8, written: 0 or 255.
        least_px: smaller patches (4-connected) are cleared; none if it is 1 or less.
        opened: whether to open the patches first, by 3 px, since pixels that the person covers
            partly are darker than a bright background, too.
        zone, need, unknown: as for `blobs.clear_small`.

    Returns:
        Whether the size of a needed patch is unknown.
    """
    cv2.inRange(labels, (WEAK,), (SHADOW,), dst=shadow)
    if opened:
        cv2.morphologyEx(shadow, cv2.MORPH_OPEN, SOLID, dst=shadow)
    if least_px <= 1.0:
        return False
    return clear_small(shadow, least_px, connectivity=4, zone=zone, need=need, unknown=unknown)


def fill_specks(labels: Mask) -> None:
    """Label weak pixels between foreground pixels as foreground, in place.

    In a noisy image only some pixels of clothes like the background differ from it by themselves;
    the patches around the others do. Opened, such a mixture would be background.

    Args:
        labels: (h, w) uint8, as of `labels.PixelLabeller`.
    """
    fill = cv2.morphologyEx(_foreground(labels), cv2.MORPH_CLOSE, SOLID)
    fill *= labels == WEAK
    cv2.bitwise_or(labels, fill, dst=labels)


def add_mixed_patches(labels: Mask, shadow: Mask) -> None:
    """Add the weak pixels of patches in which they mix with shadow and specks of foreground.

    An opening of the shadow alone removes them. Such patches are wide, unlike the seam of partly
    covered pixels around a body.

    Args:
        labels: (h, w) uint8, as of `labels.PixelLabeller`.
        shadow: (h, w) uint8, 0 or 255, of `shadow_patches`; changed.
    """
    solid = cv2.morphologyEx(_foreground(labels), cv2.MORPH_OPEN, _WIDE)
    loose = cv2.subtract(cv2.threshold(labels, 0, 255, cv2.THRESH_BINARY)[1], solid)
    wide = cv2.morphologyEx(loose, cv2.MORPH_OPEN, _WIDE)
    wide *= labels == WEAK
    cv2.bitwise_or(shadow, wide, dst=shadow)


def _foreground(labels: Mask) -> Mask:
    found = cv2.threshold(labels, SHADOW, 255, cv2.THRESH_BINARY)[1]
    return np.asarray(found, dtype=np.uint8)


SPLIT_RADIUS_PX = 3
"""Radius of the neighbourhood that a pixel's result of `split_undecided` depends on."""


def split_undecided(mask: Mask, shadow: Mask) -> None:
    """Split what is not background (0 or 255) into person and undecided, in place.

    Args:
        mask: (h, w) all that is not background; becomes the person.
        shadow: (h, w) pixels that may be shadow; becomes the undecided pixels, which include specks
            and threads of the person among them.
    """
    cv2.bitwise_and(shadow, mask, dst=shadow)
    cv2.subtract(mask, shadow, dst=mask)
    solid = cv2.morphologyEx(mask, cv2.MORPH_OPEN, SOLID)
    thin = cv2.subtract(mask, solid)
    beside = cv2.dilate(shadow, SOLID)
    cv2.bitwise_and(thin, beside, dst=thin)
    cv2.subtract(mask, thin, dst=mask)
    cv2.bitwise_or(shadow, thin, dst=shadow)


def closing_px(settings: ImagingSettings, frame_px: int) -> int:
    """Side of the closing in a frame of `frame_px` pixels, odd; see `mask.close_px`."""
    side = settings.mask.close_px * min(1.0, math.sqrt(frame_px / FULL_FRAME_PX))
    return 2 * round((side - 1.0) / 2.0) + 1 if side > 1.0 else 1


def repair_radius_px(settings: ImagingSettings, frame_px: int) -> int:
    """Radius of the neighbourhood that a pixel depends on through opening and closing, px."""
    return 2 * (settings.mask.open_px // 2) + 2 * (closing_px(settings, frame_px) // 2)


def open_and_close(mask: Mask, settings: ImagingSettings, frame_px: int) -> None:
    """Remove specks and close cracks of a mask (h, w) of a frame of `frame_px` pixels, in place."""
    if settings.mask.open_px > 1:
        cv2.morphologyEx(mask, cv2.MORPH_OPEN, disc(settings.mask.open_px), dst=mask)
    side = closing_px(settings, frame_px)
    if side > 1:
        cv2.morphologyEx(mask, cv2.MORPH_CLOSE, disc(side), dst=mask)


def clean_mask(mask: Mask, settings: ImagingSettings) -> Mask:
    """Open, close, drop small blobs, fill small holes: mask (h, w), 0 or 255, in place."""
    open_and_close(mask, settings, mask.size)
    clear_small(mask, settings.mask.blob_share * mask.size, connectivity=8)
    fill_small(mask, settings.mask.hole_share * mask.size)
    return mask
