"""Image messages as arrays: the encodings of sensor_msgs/Image that carry 8-bit grey or colour."""

from typing import Any

import cv2
import numpy as np

from markerless_tracker.errors import ImageError
from markerless_tracker.imaging import Image

# Encoding -> channels, and the OpenCV conversion to BGR (None: no conversion).
ENCODINGS: dict[str, tuple[int, int | None]] = {
    "bgr8": (3, None),
    "8UC3": (3, None),
    "rgb8": (3, cv2.COLOR_RGB2BGR),
    "bgra8": (4, cv2.COLOR_BGRA2BGR),
    "8UC4": (4, cv2.COLOR_BGRA2BGR),
    "rgba8": (4, cv2.COLOR_RGBA2BGR),
    "mono8": (1, None),
    "8UC1": (1, None),
}


def decode_raw(
    data: Any, *, encoding: str, width: int, height: int, step: int, where: str
) -> Image:
    """The image of a raw message: (h, w, 3) BGR or (h, w) grey; not copied unless converted.

    Args:
        data: the bytes (any buffer, `array.array` or uint8 array).
        encoding: one of `ENCODINGS`.
        width: columns, px.
        height: rows, px.
        step: bytes per row, padding included.
        where: camera or topic, for messages.

    Raises:
        ImageError: unknown encoding, or the sizes contradict each other.
    """
    if encoding not in ENCODINGS:
        raise ImageError(
            f"{where}: image encoding {encoding!r} is not supported, expected one of "
            f"{', '.join(ENCODINGS)}"
        )
    channels, conversion = ENCODINGS[encoding]
    raw = np.frombuffer(data, dtype=np.uint8)
    if width < 1 or height < 1 or step < width * channels or raw.size < step * height:
        raise ImageError(
            f"{where}: {raw.size} bytes for {width}x{height} px of {encoding} with {step} bytes a "
            f"row, expected at least {max(step, width * channels) * height} bytes"
        )
    rows = raw[: step * height].reshape(height, step)[:, : width * channels]
    if channels == 1:
        return np.ascontiguousarray(rows)
    image = np.ascontiguousarray(rows).reshape(height, width, channels)
    return image if conversion is None else np.asarray(cv2.cvtColor(image, conversion), np.uint8)


def decode_compressed(data: Any, *, where: str) -> Image:
    """The image of a compressed message (JPEG or PNG): (h, w, 3) BGR or (h, w) grey.

    Raises:
        ImageError: it cannot be decoded.
    """
    raw = np.frombuffer(data, dtype=np.uint8)
    image = cv2.imdecode(raw, cv2.IMREAD_ANYCOLOR) if raw.size else None
    if image is None:
        raise ImageError(f"{where}: a compressed image of {raw.size} bytes cannot be decoded")
    return np.asarray(image, dtype=np.uint8)
