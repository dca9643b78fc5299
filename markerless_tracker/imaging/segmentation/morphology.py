"""Small repairs of a silhouette: specks, cracks, holes and blobs."""

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from markerless_tracker.imaging.region import Region
from markerless_tracker.imaging.segmentation.blobs import clear_small, fill_small
from markerless_tracker.imaging.segmentation.kernels import SHADOW
from markerless_tracker.imaging.settings import ImagingSettings

Mask = NDArray[np.uint8]

# From this size of the images on, lengths set in pixels are meant as they are.
_FULL_FRAME_PX = 640 * 480


def disc(side_px: int) -> Mask:
    """A round structuring element of that side."""
    shape = cv2.MORPH_ELLIPSE if side_px > 3 else cv2.MORPH_CROSS
    return np.asarray(cv2.getStructuringElement(shape, (side_px, side_px)), dtype=np.uint8)


def patch_reach(settings: ImagingSettings, *, grey: bool) -> int:
    """How far from a pixel `foreground_mask` looks, px, but for the size of its patch."""
    share = settings.shadow.grey_blob_share if grey else settings.shadow.blob_share
    return 2 if grey and share > 0.0 else 0


def foreground_mask(
    labels: Mask,
    mask: Mask,
    least_shadow_px: float,
    *,
    grey: bool,
    zone: Region | None = None,
    need: Region | None = None,
    unknown: int = 0,
) -> bool:
    """The foreground with the shadow patches too small to be shadows.

    Args:
        labels: (h, w) uint8: 0 background, 127 shadow, 255 foreground.
        mask: (h, w) uint8, written: 0 or 255.
        least_shadow_px: smaller patches of shadow (4-connected) become foreground.
        grey: the patches are opened first; the value ratio alone leaves them ragged.
        zone, need, unknown: as `blobs.clear_small` takes them.

    Returns:
        Whether a needed patch's size is not known.
    """
    if least_shadow_px <= 1.0:
        cv2.threshold(labels, SHADOW, 255, cv2.THRESH_BINARY, dst=mask)
        return False
    cv2.threshold(labels, 0, 255, cv2.THRESH_BINARY, dst=mask)
    shadow = np.asarray(cv2.inRange(labels, (SHADOW,), (SHADOW,)), dtype=np.uint8)
    if grey:
        cv2.morphologyEx(shadow, cv2.MORPH_OPEN, np.ones((3, 3), dtype=np.uint8), dst=shadow)
    asked = clear_small(
        shadow, least_shadow_px, connectivity=4, zone=zone, need=need, unknown=unknown
    )
    cv2.subtract(mask, shadow, dst=mask)
    return asked


def closing_px(settings: ImagingSettings, frame_px: int) -> int:
    """Side of the closing in a frame of that many pixels, odd; `mask.close_px` says how."""
    side = settings.mask.close_px * min(1.0, math.sqrt(frame_px / _FULL_FRAME_PX))
    return 2 * round((side - 1.0) / 2.0) + 1 if side > 1.0 else 1


def repair_reach(settings: ImagingSettings, frame_px: int) -> int:
    """How far from a pixel opening and closing look, px."""
    return 2 * (settings.mask.open_px // 2) + 2 * (closing_px(settings, frame_px) // 2)


def open_and_close(mask: Mask, settings: ImagingSettings, frame_px: int) -> None:
    """Remove specks and close cracks of a mask (h, w) of a frame of that many pixels, in place."""
    if settings.mask.open_px > 1:
        cv2.morphologyEx(mask, cv2.MORPH_OPEN, disc(settings.mask.open_px), dst=mask)
    side = closing_px(settings, frame_px)
    if side > 1:
        cv2.morphologyEx(mask, cv2.MORPH_CLOSE, disc(side), dst=mask)


def clean_mask(mask: Mask, settings: ImagingSettings) -> Mask:
    """Open, close, drop small blobs, fill small holes: mask (h, w), 0 or 255, in place."""
    open_and_close(mask, settings, mask.size)
    drop_blobs(mask, settings.mask.blob_share * mask.size)
    fill_holes(mask, settings.mask.hole_share * mask.size)
    return mask


def drop_blobs(mask: Mask, least_px: float) -> None:
    """Clear 8-connected blobs of fewer than ``least_px`` pixels, in place."""
    clear_small(mask, least_px, connectivity=8)


def fill_holes(mask: Mask, largest_px: float) -> None:
    """Set 4-connected gaps of fewer than ``largest_px`` pixels inside the image, in place.

    A gap that reaches the border of the mask's bounding box is no hole.
    """
    fill_small(mask, largest_px)
