"""Image messages as arrays: encodings of sensor_msgs/Image with 8 bits a channel; JPEG and PNG."""

import struct
from typing import Any, NamedTuple

import cv2
import numpy as np

from markerless_tracker.errors import ImageError
from markerless_tracker.imaging import Image

# Encoding -> bytes per pixel, and the OpenCV conversion to BGR (None: no conversion). OpenCV names
# a Bayer pattern by the second row's second and third pixel, ROS by the first pixels.
ENCODINGS: dict[str, tuple[int, int | None]] = {
    "bgr8": (3, None),
    "8UC3": (3, None),
    "rgb8": (3, cv2.COLOR_RGB2BGR),
    "bgra8": (4, cv2.COLOR_BGRA2BGR),
    "8UC4": (4, cv2.COLOR_BGRA2BGR),
    "rgba8": (4, cv2.COLOR_RGBA2BGR),
    "mono8": (1, None),
    "8UC1": (1, None),
    "bayer_rggb8": (1, cv2.COLOR_BayerBG2BGR),
    "bayer_bggr8": (1, cv2.COLOR_BayerRG2BGR),
    "bayer_gbrg8": (1, cv2.COLOR_BayerGR2BGR),
    "bayer_grbg8": (1, cv2.COLOR_BayerGB2BGR),
    "uyvy": (2, cv2.COLOR_YUV2BGR_UYVY),
    "yuv422": (2, cv2.COLOR_YUV2BGR_UYVY),
    "yuyv": (2, cv2.COLOR_YUV2BGR_YUY2),
    "yuv422_yuy2": (2, cv2.COLOR_YUV2BGR_YUY2),
}

_IN_PAIRS = frozenset({cv2.COLOR_YUV2BGR_UYVY, cv2.COLOR_YUV2BGR_YUY2})
"""Conversions of encodings in which two pixels share their colour."""
_PNG = b"\x89PNG\r\n\x1a\n"
_PNG_GREY = (0, 4)
"""Colour types of PNG without colour: grey, grey with alpha."""
_JPEG_FRAMES = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
"""Markers of JPEG that begin a frame, hence give its size."""


class Layout(NamedTuple):
    """Size of an image, px, and its channels once decoded: 1 (grey) or 3 (BGR)."""

    width: int
    height: int
    channels: int


def decoded_channels(encoding: str) -> int:
    """Channels of the decoded image of one of `ENCODINGS`: 1 (grey) or 3 (BGR)."""
    return 1 if ENCODINGS[encoding] == (1, None) else 3


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
        ImageError: unknown encoding, sizes that contradict each other or that the encoding cannot
            have (an odd width of YUV 4:2:2, a Bayer pattern of one row).
    """
    if encoding not in ENCODINGS:
        raise ImageError(
            f"{where}: image encoding {encoding!r} is not supported, expected one of "
            f"{', '.join(ENCODINGS)}"
        )
    size, conversion = ENCODINGS[encoding]
    raw = np.frombuffer(data, dtype=np.uint8)
    if width < 1 or height < 1 or step < width * size or raw.size < step * height:
        raise ImageError(
            f"{where}: {raw.size} bytes for {width}x{height} px of {encoding} with {step} bytes a "
            f"row, expected at least {max(step, width * size) * height} bytes"
        )
    rows = np.ascontiguousarray(raw[: step * height].reshape(height, step)[:, : width * size])
    image = rows if size == 1 else rows.reshape(height, width, size)
    if conversion is None:
        return image
    # OpenCV 4.6 would decode it and leave a column out.
    if conversion in _IN_PAIRS and width % 2:
        raise ImageError(
            f"{where}: {width}x{height} px cannot be {encoding}, expected an even width"
        )
    try:
        return np.asarray(cv2.cvtColor(image, conversion), np.uint8)
    except cv2.error as error:
        raise ImageError(f"{where}: {width}x{height} px cannot be {encoding}") from error


def compressed_layout(data: Any, *, where: str) -> Layout:
    """Size and channels of a JPEG or PNG, from its header.

    Raises:
        ImageError: it is neither, or cut before its size.
    """
    head = memoryview(data)
    try:
        if bytes(head[:8]) == _PNG:
            width, height, _, kind = struct.unpack_from(">IIBB", head, 16)
            return Layout(width, height, 1 if kind in _PNG_GREY else 3)
        if bytes(head[:2]) == b"\xff\xd8":
            return _jpeg_layout(head)
    except struct.error:
        pass
    raise ImageError(f"{where}: a compressed image of {len(head)} bytes, expected a JPEG or PNG")


def _jpeg_layout(data: memoryview) -> Layout:
    """Size and channels of a JPEG: segments are a marker, their length and their content."""
    at = 2
    while True:
        mark, marker, length = struct.unpack_from(">BBH", data, at)
        if mark != 0xFF:
            raise struct.error
        if marker == 0xFF:  # fill
            at += 1
            continue
        if marker in _JPEG_FRAMES:
            _, height, width, components = struct.unpack_from(">BHHB", data, at + 4)
            return Layout(width, height, 1 if components == 1 else 3)
        at += 2 + length


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
