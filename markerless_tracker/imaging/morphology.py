"""Small repairs of a silhouette: specks, cracks, holes and blobs."""

import cv2
import numpy as np
from numpy.typing import NDArray

from markerless_tracker.imaging.kernels import SHADOW
from markerless_tracker.imaging.settings import ImagingSettings

Mask = NDArray[np.uint8]


def disc(side_px: int) -> Mask:
    """A round structuring element of that side."""
    shape = cv2.MORPH_ELLIPSE if side_px > 3 else cv2.MORPH_CROSS
    return np.asarray(cv2.getStructuringElement(shape, (side_px, side_px)), dtype=np.uint8)


def foreground_mask(labels: Mask, mask: Mask, least_shadow_px: float, *, grey: bool) -> None:
    """The foreground with the shadow patches too small to be shadows.

    Args:
        labels: (h, w) uint8: 0 background, 127 shadow, 255 foreground.
        mask: (h, w) uint8, written: 0 or 255.
        least_shadow_px: smaller patches of shadow (4-connected) become foreground.
        grey: the patches are opened first; the value ratio alone leaves them ragged.
    """
    if least_shadow_px <= 1.0:
        cv2.threshold(labels, SHADOW, 255, cv2.THRESH_BINARY, dst=mask)
        return
    cv2.threshold(labels, 0, 255, cv2.THRESH_BINARY, dst=mask)
    shadow = np.asarray(cv2.inRange(labels, (SHADOW,), (SHADOW,)), dtype=np.uint8)
    if grey:
        cv2.morphologyEx(shadow, cv2.MORPH_OPEN, np.ones((3, 3), dtype=np.uint8), dst=shadow)
    window = occupied(shadow)
    patches = np.ascontiguousarray(window)
    _clear_small(patches, least_shadow_px, 4)
    window[...] = patches
    cv2.subtract(mask, shadow, dst=mask)


def clean_mask(mask: Mask, settings: ImagingSettings) -> Mask:
    """Open, close, drop small blobs, fill small holes: mask (h, w), 0 or 255, in place."""
    if settings.mask_open_px > 1:
        cv2.morphologyEx(mask, cv2.MORPH_OPEN, disc(settings.mask_open_px), dst=mask)
    if settings.mask_close_px > 1:
        cv2.morphologyEx(mask, cv2.MORPH_CLOSE, disc(settings.mask_close_px), dst=mask)
    drop_blobs(mask, settings.mask_blob_share * mask.size)
    fill_holes(mask, settings.mask_hole_share * mask.size)
    return mask


def drop_blobs(mask: Mask, least_px: float) -> None:
    """Clear 8-connected blobs of fewer than ``least_px`` pixels, in place."""
    window = occupied(mask)
    part = np.ascontiguousarray(window)
    _clear_small(part, least_px, 8)
    window[...] = part


def fill_holes(mask: Mask, largest_px: float) -> None:
    """Set 4-connected gaps of fewer than ``largest_px`` pixels inside the image, in place.

    A gap that reaches the border of the mask's bounding box is no hole.
    """
    window = occupied(mask)
    if window.size == 0:
        return
    gaps = np.asarray(cv2.bitwise_not(window), dtype=np.uint8)
    _clear_small(gaps, largest_px, 4, spare_border=True)
    cv2.bitwise_not(gaps, dst=gaps)
    window[...] = gaps


def occupied(mask: Mask) -> Mask:
    """The part of the mask inside its bounding box: labelling empty image is what costs most."""
    left, top, width, height = cv2.boundingRect(mask)
    return mask[top : top + height, left : left + width]


def _clear_small(
    mask: Mask, least_px: float, connectivity: int, *, spare_border: bool = False
) -> None:
    if mask.size == 0:
        return
    _, labels, stats, _ = cv2.connectedComponentsWithStats(
        mask, connectivity=connectivity, ltype=cv2.CV_32S
    )
    keep = stats[:, cv2.CC_STAT_AREA] >= least_px
    if spare_border:
        right = stats[:, cv2.CC_STAT_LEFT] + stats[:, cv2.CC_STAT_WIDTH]
        bottom = stats[:, cv2.CC_STAT_TOP] + stats[:, cv2.CC_STAT_HEIGHT]
        keep |= (stats[:, cv2.CC_STAT_LEFT] == 0) | (stats[:, cv2.CC_STAT_TOP] == 0)
        keep |= (right == mask.shape[1]) | (bottom == mask.shape[0])
    if keep[1:].all():
        return
    keep[0] = False
    mask[...] = (keep.astype(np.uint8) * np.uint8(255))[labels]
