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
    """Open, close, fill small holes, drop small blobs: mask (h, w) of 0 and 255, changed in place."""
    if settings.mask_open_px > 1:
        cv2.morphologyEx(mask, cv2.MORPH_OPEN, disc(settings.mask_open_px), dst=mask)
    if settings.mask_close_px > 1:
        cv2.morphologyEx(mask, cv2.MORPH_CLOSE, disc(settings.mask_close_px), dst=mask)
    drop_blobs(mask, settings.mask_blob_share * mask.size)
    fill_holes(mask, settings.mask_hole_share * mask.size)
    return mask


def drop_blobs(mask: Mask, least_px: float) -> None:
    """Clear 8-connected blobs of fewer than ``least_px`` pixels, in place."""
    _recolour_small(mask, least_px, 8, 0)


def fill_holes(mask: Mask, largest_px: float) -> None:
    """Set 4-connected gaps of fewer than ``largest_px`` pixels that do not touch the border, in place."""
    inverse = cv2.bitwise_not(mask)
    _recolour_small(inverse, largest_px, 4, 0, spare_border=True)
    cv2.bitwise_not(inverse, dst=mask)


def _recolour_small(
    mask: Mask, least_px: float, connectivity: int, colour: int, *, spare_border: bool = False
) -> None:
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
        mask[window][labels[window] == index] = colour
