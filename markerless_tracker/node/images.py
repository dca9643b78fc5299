"""sensor_msgs/Image and numpy arrays, without cv_bridge and with as few copies as possible."""

import array
from typing import Any, Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from markerless_tracker.errors import ImageError

Array = NDArray[np.uint8]

CHANNELS = {"mono8": 1, "8UC1": 1, "bgr8": 3, "8UC3": 3, "rgb8": 3, "bgra8": 4, "rgba8": 4}
"""Encodings understood, with their channels."""

_TO_BGR = {
    "rgb8": cv2.COLOR_RGB2BGR,
    "bgra8": cv2.COLOR_BGRA2BGR,
    "rgba8": cv2.COLOR_RGBA2BGR,
}


class ImageLike(Protocol):
    """The fields of sensor_msgs/Image that are read here."""

    height: int
    width: int
    encoding: str
    step: int
    data: Any


def decode_image(message: ImageLike, topic: str) -> Array:
    """The image of a sensor_msgs/Image as C-contiguous uint8, BGR (h, w, 3) or grey (h, w).

    Shares the message's memory for mono8 and bgr8 without padding; padded rows, RGB and alpha
    channels (dropped) cost one copy. ``is_bigendian`` says nothing about 8-bit channels.

    Args:
        message: the message.
        topic: where it came from, for error messages.

    Raises:
        ImageError: unknown encoding, or width, height, step and data that do not fit each other.
    """
    encoding = message.encoding
    channels = CHANNELS.get(encoding)
    if channels is None:
        raise ImageError(
            f"{topic}: encoding {encoding!r} is not understood, expected one of "
            f"{', '.join(CHANNELS)}"
        )
    height, width, step = message.height, message.width, message.step
    buffer = np.frombuffer(message.data, dtype=np.uint8) if len(message.data) else _NOTHING
    if height < 1 or width < 1 or step < width * channels or buffer.size != height * step:
        raise ImageError(
            f"{topic}: {buffer.size} bytes in rows of {step} do not make an image of "
            f"{width}x{height} px {encoding}, expected {height} rows of at least "
            f"{max(width, 1) * channels} bytes and nothing else"
        )
    rows = buffer.reshape(height, step)[:, : width * channels]
    pixels = np.ascontiguousarray(rows)
    if channels == 1:
        return pixels
    pixels = pixels.reshape(height, width, channels)
    if encoding in _TO_BGR:
        return np.asarray(cv2.cvtColor(pixels, _TO_BGR[encoding]), dtype=np.uint8)
    return pixels


_NOTHING: Array = np.empty(0, dtype=np.uint8)


def fill_image(message: Any, image: Array, topic: str) -> Any:
    """Fill height, width, encoding, step and data of a sensor_msgs/Image; returns the message.

    Args:
        message: a sensor_msgs/Image; its header is left alone.
        image: uint8, (h, w) becomes mono8, (h, w, 3) bgr8, (h, w, 4) bgra8.
        topic: where it goes, for the error message.

    Raises:
        ImageError: an array that is no such image.
    """
    encoding = {2: "mono8", 3: {3: "bgr8", 4: "bgra8"}.get(image.shape[-1])}.get(image.ndim)
    if image.dtype != np.uint8 or encoding is None or image.size == 0:
        raise ImageError(
            f"{topic}: array {image.shape} of {image.dtype} is no image, "
            "expected uint8 (h, w), (h, w, 3) or (h, w, 4)"
        )
    message.height, message.width = int(image.shape[0]), int(image.shape[1])
    message.encoding = encoding
    message.is_bigendian = 0
    message.step = message.width * CHANNELS[encoding]
    # Assigning the ndarray itself is checked byte by byte: a hundred times slower.
    data = array.array("B")
    data.frombytes(memoryview(np.ascontiguousarray(image)).cast("B"))
    message.data = data
    return message
