"""Silhouettes as images on disk."""

from pathlib import Path

import numpy as np

from markerless_tracker.datasets.video.images import numbered_files, read_image
from markerless_tracker.errors import DatasetError
from markerless_tracker.imaging import Image, scale_image

_PERSON = 128
"""Least grey level of the person."""


def read_mask(path: Path, size_px: tuple[int, int]) -> Image:
    """A silhouette (h, w), 0 or 255: person where the largest channel is 128 or more.

    Args:
        path: the image.
        size_px: (width, height) to which it is scaled; pixels that are half covered are person.

    Raises:
        DatasetError: it cannot be read.
    """
    image = read_image(path)
    grey = image if image.ndim == 2 else image.max(axis=2)
    return _as_mask(scale_image(_as_mask(grey), size_px))


def masks_by_frame(folder: Path) -> dict[int, Path]:
    """Frame index -> silhouette of a folder, whose files are named by it, such as 000050.png.

    Raises:
        DatasetError: a file's name is no number.
    """
    files = numbered_files(folder)
    for file in files:
        if not file.stem.isdecimal():
            raise DatasetError(f"{file}: expected a frame number as its name, such as 000050.png")
    return {int(file.stem): file for file in files}


def _as_mask(image: Image) -> Image:
    return np.where(image >= _PERSON, 255, 0).astype(np.uint8)
