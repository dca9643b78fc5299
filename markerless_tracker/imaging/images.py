"""Images: checks, conversion to grey, scaling."""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from markerless_tracker.errors import ImageError

Image = NDArray[np.uint8]
"""(h, w) grey or (h, w, 3) BGR, grey levels."""
FloatImage = NDArray[np.float32]
"""(h, w) or (h, w, c): means, variances or weights of pixels."""


def check_image(image: Any, what: str, *, size_px: tuple[int, int] | None = None) -> Image:
    """Return the image if it is uint8 (h, w) or (h, w, 3), not empty, and of the given size.

    Args:
        image: the value to check.
        what: name for the error message (camera or file).
        size_px: expected (width, height); None = any.

    Raises:
        ImageError: it is not; the message describes the value.
    """
    if not isinstance(image, np.ndarray):
        raise ImageError(f"{what}: got {type(image).__name__}, expected an image array")
    if image.dtype != np.uint8 or not (
        image.ndim == 2 or (image.ndim == 3 and image.shape[2] == 3)
    ):
        raise ImageError(
            f"{what}: got an image of {image.dtype} {image.shape}, "
            "expected uint8 (h, w) or (h, w, 3)"
        )
    if image.size == 0:
        raise ImageError(f"{what}: got an empty image {image.shape}")
    if size_px is not None and (image.shape[1], image.shape[0]) != tuple(size_px):
        raise ImageError(
            f"{what}: got an image of {image.shape[1]}x{image.shape[0]} px, "
            f"expected {size_px[0]}x{size_px[1]} px"
        )
    return image


def grey_of(image: Image) -> Image:
    """The image (h, w) or (h, w, c) as grey (h, w); three equal channels keep their value."""
    if image.ndim == 2:
        return image
    if image.shape[2] == 1:
        return image[:, :, 0]
    return np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), dtype=np.uint8)


def scale_image(image: Image, size_px: tuple[int, int]) -> Image:
    """The image at ``size_px`` = (width, height); the same object if it already has that size.

    By area averaging: a pixel's centre (u, v) moves to ((u + 0.5) s - 0.5, ...), like the principal
    point in `CameraModel.scaled`.

    Raises:
        ImageError: not an image, or a size below one pixel.
    """
    check_image(image, "image to scale")
    width, height = size_px
    if width < 1 or height < 1:
        raise ImageError(
            f"image to scale: got a size of {width}x{height} px, expected at least 1x1"
        )
    if (image.shape[1], image.shape[0]) == (width, height):
        return image
    return np.asarray(
        cv2.resize(image, (int(width), int(height)), interpolation=cv2.INTER_AREA), dtype=np.uint8
    )
