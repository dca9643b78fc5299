"""Small repairs of a silhouette: specks, cracks, holes and blobs."""

import cv2
import numpy as np
from numpy.typing import NDArray

from markerless_tracker.imaging.settings import ImagingSettings

Mask = NDArray[np.uint8]


def disc(side_px: int) -> Mask:
    """A round structuring element of that side."""
    shape = cv2.MORPH_ELLIPSE if side_px > 3 else cv2.MORPH_CROSS
    return np.asarray(cv2.getStructuringElement(shape, (side_px, side_px)), dtype=np.uint8)


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
    window = _occupied(mask)
    part = np.ascontiguousarray(window)
    _clear_small(part, least_px, 8)
    window[...] = part


def fill_holes(mask: Mask, largest_px: float) -> None:
    """Set 4-connected gaps of fewer than ``largest_px`` pixels inside the image, in place.

    A gap that reaches the border of the mask's bounding box is no hole.
    """
    window = _occupied(mask)
    if window.size == 0:
        return
    gaps = np.asarray(cv2.bitwise_not(window), dtype=np.uint8)
    _clear_small(gaps, largest_px, 4, spare_border=True)
    cv2.bitwise_not(gaps, dst=gaps)
    window[...] = gaps


def _occupied(mask: Mask) -> Mask:
    """The part of the mask inside its bounding box: labelling empty image is what costs most."""
    left, top, width, height = cv2.boundingRect(mask)
    return mask[top : top + height, left : left + width]


def _clear_small(
    mask: Mask, least_px: float, connectivity: int, *, spare_border: bool = False
) -> None:
    if mask.size == 0:
        return
    count, labels, stats, _ = cv2.connectedComponentsWithStats(
        mask, connectivity=connectivity, ltype=cv2.CV_32S
    )
    height, width = mask.shape
    for index in range(1, count):
        left, top, w, h, area = (int(x) for x in stats[index])
        if area >= least_px:
            continue
        if spare_border and (left == 0 or top == 0 or left + w == width or top + h == height):
            continue
        window = (slice(top, top + h), slice(left, left + w))
        mask[window][labels[window] == index] = 0
