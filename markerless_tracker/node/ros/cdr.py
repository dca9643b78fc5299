"""Image messages as serialised bytes (CDR), read and written without a copy of the pixels.

Layout: four bytes of encapsulation (the second one's lowest bit: little endian), then the fields in
order, each at a multiple of its own size counted from the end of the encapsulation. A string is its
length with the terminating zero (uint32) and its bytes; a sequence its length and its elements.
"""

import struct
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.datasets.bag.encodings import compressed_layout
from markerless_tracker.errors import ImageError

_START = 4
"""Bytes of the encapsulation."""
_PLAIN_CDR = ((0, 0), (0, 1))
"""Encapsulations of plain CDR, big and little endian."""
_SECOND_NS = 1_000_000_000


@dataclass(frozen=True, eq=False)
class ImageMessage:
    """The fields of a sensor_msgs/Image.

    Attributes:
        stamp_ns: time of the header, ns.
        frame_id: frame of the header.
        height, width: px.
        encoding: its name.
        step: bytes per row.
        data: (n,) uint8, the message's own memory; must not be changed.
    """

    stamp_ns: int
    frame_id: str
    height: int
    width: int
    encoding: str
    step: int
    data: NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class CompressedMessage:
    """The fields of a sensor_msgs/CompressedImage.

    Attributes:
        stamp_ns: time of the header, ns.
        frame_id: frame of the header.
        format: its name.
        data: (n,) uint8, the message's own memory; must not be changed.
        width, height: of the image, px, from the header of the JPEG or PNG.
        channels: of the decoded image: 1 (grey) or 3 (BGR).
    """

    stamp_ns: int
    frame_id: str
    format: str
    data: NDArray[np.uint8]
    width: int
    height: int
    channels: int


class _Fields:
    """Reads the fields of a serialised message one after the other."""

    def __init__(self, message: bytes, topic: str) -> None:
        self._message, self._topic = message, topic
        if tuple(message[:2]) not in _PLAIN_CDR:
            raise ImageError(
                f"{topic}: a message that begins with {message[:2].hex()!r}, expected plain CDR"
            )
        self._order = "<" if message[1] else ">"
        self.at = _START

    def numbers(self, kinds: str) -> tuple[int, ...]:
        """Numbers of one size, by the characters of `struct`."""
        layout = struct.Struct(self._order + kinds)
        size = layout.size // len(kinds)
        self.at += -(self.at - _START) % size
        self._require(layout.size)
        values = layout.unpack_from(self._message, self.at)
        self.at += layout.size
        return values

    def header(self) -> tuple[int, str]:
        """Stamp, ns, and frame of a std_msgs/Header."""
        seconds, *_ = self.numbers("i")
        nanoseconds, *_ = self.numbers("I")
        return seconds * _SECOND_NS + nanoseconds, self.text()

    def text(self) -> str:
        """A string; bytes that are no UTF-8 are replaced."""
        (size,) = self.numbers("I")
        self._require(size)
        found = self._message[self.at : self.at + size].rstrip(b"\0")
        self.at += size
        return found.decode("utf-8", "replace")

    def elements(self) -> NDArray[np.uint8]:
        """The bytes of a sequence, in place."""
        (size,) = self.numbers("I")
        self._require(size)
        return np.frombuffer(self._message, np.uint8, size, self.at)

    def _require(self, size: int) -> None:
        if self.at + size > len(self._message):
            raise ImageError(
                f"{self._topic}: a message of {len(self._message)} bytes is cut, expected at least "
                f"{self.at + size}"
            )


def read_image(message: bytes, topic: str) -> ImageMessage:
    """The fields of a serialised sensor_msgs/Image.

    Args:
        message: the bytes, encapsulation included.
        topic: its topic, for error messages.

    Raises:
        ImageError: not plain CDR, or shorter than its own lengths say.
    """
    fields = _Fields(message, topic)
    stamp_ns, frame_id = fields.header()
    height, width = fields.numbers("II")
    encoding = fields.text()
    fields.numbers("B")  # is_bigendian
    (step,) = fields.numbers("I")
    data = _writable(fields.elements())
    return ImageMessage(stamp_ns, frame_id, height, width, encoding, step, data)


def read_compressed(message: bytes, topic: str) -> CompressedMessage:
    """The fields of a serialised sensor_msgs/CompressedImage.

    Args:
        message: the bytes, encapsulation included.
        topic: its topic, for error messages.

    Raises:
        ImageError: not plain CDR, shorter than its own lengths say, or neither JPEG nor PNG.
    """
    stamp_ns, frame_id, kind, data = compressed_fields(message, topic)
    layout = compressed_layout(data, where=topic)
    return CompressedMessage(stamp_ns, frame_id, kind, data, *layout)


def compressed_fields(message: bytes, topic: str) -> tuple[int, str, str, NDArray[np.uint8]]:
    """Stamp (ns), frame, format and data (n,) of a serialised sensor_msgs/CompressedImage.

    Raises:
        ImageError: not plain CDR, or shorter than its own lengths say.
    """
    fields = _Fields(message, topic)
    stamp_ns, frame_id = fields.header()
    kind = fields.text()
    return stamp_ns, frame_id, kind, fields.elements()


def image_bytes(image: NDArray[np.uint8], stamp_ns: int, frame_id: str) -> bytes:
    """A serialised sensor_msgs/Image (little endian), with one copy of the pixels.

    Args:
        image: uint8, C-contiguous: (h, w) becomes mono8, (h, w, 3) bgr8.
        stamp_ns: time of the header, ns.
        frame_id: frame of the header.

    Raises:
        ImageError: another type or shape.
    """
    channels = image.shape[2] if image.ndim == 3 else 1
    good = image.dtype == np.uint8 and image.ndim in (2, 3) and channels == 2 * image.ndim - 3
    if not good or image.size == 0:
        raise ImageError(
            f"{frame_id}: an array {image.shape} of {image.dtype} is no image, "
            "expected uint8 (h, w) or (h, w, 3)"
        )
    height, width = image.shape[:2]
    head = bytearray(b"\0\1\0\0")
    head += struct.pack("<iI", *divmod(stamp_ns, _SECOND_NS))
    _put_text(head, frame_id)
    _pad(head)
    head += struct.pack("<II", height, width)
    _put_text(head, "mono8" if channels == 1 else "bgr8")
    head += b"\0"  # is_bigendian
    _pad(head)
    head += struct.pack("<II", width * channels, image.size)
    pixels = np.ascontiguousarray(image).data
    return b"".join((head, pixels))


def with_stamp(message: bytes, stamp_ns: int) -> bytes:
    """A serialised message that begins with a std_msgs/Header, with another stamp (ns)."""
    order = "<" if message[1] & 1 else ">"
    stamp = struct.pack(f"{order}iI", *divmod(stamp_ns, _SECOND_NS))
    return message[:_START] + stamp + message[_START + 8 :]


def without_stamp(message: bytes) -> bytes:
    """A serialised message that begins with a std_msgs/Header, without its stamp."""
    return message[:_START] + message[_START + 8 :]


def _put_text(head: bytearray, text: str) -> None:
    _pad(head)
    encoded = text.encode() + b"\0"
    head += struct.pack("<I", len(encoded)) + encoded


def _pad(head: bytearray) -> None:
    head += bytes(-(len(head) - _START) % 4)


class _Borrowed:
    """The memory of an array, declared as writable."""

    def __init__(self, array: NDArray[np.uint8]) -> None:
        self._array = array
        interface: dict[str, Any] = dict(array.__array_interface__)
        self.__array_interface__ = {**interface, "data": (interface["data"][0], False)}


def _writable(array: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """The same array, not marked as read-only, for which numba would compile all kernels again."""
    return np.asarray(_Borrowed(array))
