"""Conversion between image messages and numpy arrays, without cv_bridge, with few copies."""

import array
from typing import Any, Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from markerless_tracker.datasets.bag.encodings import (
    ENCODINGS,
    decode_compressed,
    decode_raw,
    decoded_channels,
)
from markerless_tracker.errors import ImageError
from markerless_tracker.node.ros.cdr import CompressedMessage, ImageMessage

Array = NDArray[np.uint8]

# Largest number of characters of a received text in an error message.
_SHOWN = 80


class ImageLike(Protocol):
    """The fields of sensor_msgs/Image that are read here; `cdr.ImageMessage` has them, too."""

    @property
    def height(self) -> int:
        """Rows, px."""

    @property
    def width(self) -> int:
        """Columns, px."""

    @property
    def encoding(self) -> str:
        """Name of the encoding."""

    @property
    def step(self) -> int:
        """Bytes per row."""

    @property
    def data(self) -> Any:
        """The bytes, any buffer with a length."""


def check_layout(message: ImageLike, topic: str) -> None:
    """Make sure that a sensor_msgs/Image can be decoded, without reading its pixels.

    Args:
        message: the message.
        topic: its topic, for error messages.

    Raises:
        ImageError: unknown encoding, or inconsistent width, height, step and data.
    """
    if message.encoding not in ENCODINGS:
        raise ImageError(
            f"{topic}: image encoding {message.encoding[:_SHOWN]!r} is not known, expected one of "
            f"{', '.join(ENCODINGS)}"
        )
    pixel = ENCODINGS[message.encoding][0]
    height, width, step, size = message.height, message.width, message.step, len(message.data)
    if height < 1 or width < 1 or step < width * pixel or size != height * step:
        raise ImageError(
            f"{topic}: {size} bytes in rows of {step} are no image of {width}x{height} px "
            f"{message.encoding}, expected {height} rows of at least {width * pixel} bytes"
        )


def received_channels(message: ImageMessage | CompressedMessage) -> int:
    """Channels of the decoded image of a checked message: 1 (grey) or 3 (BGR)."""
    if isinstance(message, CompressedMessage):
        return message.channels
    return decoded_channels(message.encoding)


def decode_received(message: ImageMessage | CompressedMessage, topic: str) -> Array:
    """The image of a received message: as `decode_image`, or decoded from JPEG or PNG.

    Raises:
        ImageError: it cannot be decoded, or disagrees with its header.
    """
    if not isinstance(message, CompressedMessage):
        return decode_image(message, topic)
    image = decode_compressed(message.data, where=topic)
    if image.shape[:2] != (message.height, message.width):
        raise ImageError(
            f"{topic}: an image of {image.shape[1]}x{image.shape[0]} px came, its header says "
            f"{message.width}x{message.height} px"
        )
    if image.ndim == 2 and message.channels == 3:
        return np.asarray(cv2.cvtColor(image, cv2.COLOR_GRAY2BGR), np.uint8)
    return image


def decode_image(message: ImageLike, topic: str) -> Array:
    """The image of a sensor_msgs/Image as C-contiguous uint8, BGR (h, w, 3) or grey (h, w).

    Shares the message's memory for mono8 and bgr8 without padding; padded rows and other encodings
    cost one copy; alpha channels are dropped. ``is_bigendian`` does not matter for 8-bit channels.

    Raises:
        ImageError: as `check_layout`.
    """
    check_layout(message, topic)
    return decode_raw(
        message.data,
        encoding=message.encoding,
        width=message.width,
        height=message.height,
        step=message.step,
        where=topic,
    )


def fill_image(message: Any, image: Array, topic: str) -> Any:
    """Fill height, width, encoding, step and data of a sensor_msgs/Image; returns the message.

    Args:
        message: a sensor_msgs/Image; its header is not changed.
        image: uint8, (h, w) becomes mono8, (h, w, 3) bgr8.
        topic: its topic, for the error message.

    Raises:
        ImageError: another type or shape.
    """
    channels = image.shape[2] if image.ndim == 3 else 1
    good = image.dtype == np.uint8 and image.ndim in (2, 3) and channels == 2 * image.ndim - 3
    if not good or image.size == 0:
        raise ImageError(
            f"{topic}: an array {image.shape} of {image.dtype} is no image, "
            "expected uint8 (h, w) or (h, w, 3)"
        )
    message.height, message.width = int(image.shape[0]), int(image.shape[1])
    message.encoding = "mono8" if image.ndim == 2 else "bgr8"
    message.is_bigendian = 0
    message.step = message.width * channels
    # rclpy checks an assigned ndarray byte by byte, which is a hundred times slower.
    data = array.array("B")
    data.frombytes(np.ascontiguousarray(image).data.cast("B"))
    message.data = data
    return message
