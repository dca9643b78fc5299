"""tf2_msgs/TFMessage as serialised bytes (CDR): names are written once, numbers per message.

tf2_msgs may be missing (`installed`): pip has no wheel of it.
"""

import struct
from collections.abc import Sequence
from importlib.util import find_spec

import numpy as np

from markerless_tracker.geometry import FloatArray

TF_CHOICES = ("links", "root", "none")
"""Transforms of a body that a tracker publishes: of all links, of the root link, none."""
_START = 4
"""Bytes of the encapsulation."""
_SECOND_NS = 1_000_000_000
_NUMBERS = 7
"""Doubles of a geometry_msgs/Transform: translation x, y, z and quaternion x, y, z, w."""


def installed() -> bool:
    """Whether tf2_msgs can be imported."""
    return find_spec("tf2_msgs") is not None


class TransformMessages:
    """Serialises the transforms of a fixed list of frames.

    Args:
        frames: (parent, child) of each transform.
    """

    def __init__(self, frames: Sequence[tuple[str, str]]) -> None:
        self.frames = tuple(frames)
        message = bytearray(b"\0\1\0\0")
        message += struct.pack("<I", len(self.frames))
        stamps, numbers = [], []
        for parent, child in self.frames:
            _pad(message, 4)
            stamps.append(len(message))
            message += bytes(8)
            for name in (parent, child):
                _pad(message, 4)
                encoded = name.encode() + b"\0"
                message += struct.pack("<I", len(encoded)) + encoded
            _pad(message, 8)
            numbers.append(len(message))
            message += bytes(8 * _NUMBERS)
        self._message = np.frombuffer(bytes(message), np.uint8)
        self._stamps = np.add.outer(np.array(stamps, dtype=np.int64), np.arange(8))
        self._numbers = np.add.outer(np.array(numbers, dtype=np.int64), np.arange(8 * _NUMBERS))

    def serialised(
        self, stamp_ns: int, translations_m: FloatArray, quaternions: FloatArray
    ) -> bytes:
        """A message with all transforms at one time.

        Args:
            stamp_ns: time, ns.
            translations_m: (n, 3) of the children in their parents, in the order of the frames.
            quaternions: (n, 4) (w, x, y, z), takes children's axes to their parents'.
        """
        message = self._message.copy()
        stamp = struct.pack("<iI", *divmod(stamp_ns, _SECOND_NS))
        message[self._stamps] = np.frombuffer(stamp, np.uint8)
        numbers = np.empty((len(self.frames), _NUMBERS), dtype="<f8")
        numbers[:, :3] = translations_m
        numbers[:, 3:6], numbers[:, 6] = quaternions[:, 1:], quaternions[:, 0]
        message[self._numbers] = numbers.view(np.uint8)
        return message.tobytes()


def _pad(message: bytearray, size: int) -> None:
    message += bytes(-(len(message) - _START) % size)
