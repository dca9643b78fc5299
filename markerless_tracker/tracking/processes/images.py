"""Images in shared memory."""

import mmap
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from markerless_tracker.camera import CameraRig
from markerless_tracker.imaging import Image

_ALIGNED = 64
_CHANNELS = 3


class Place(NamedTuple):
    """Place of an image in the shared memory.

    Attributes:
        offset: of its first byte.
        shape: (h, w) or (h, w, 3), uint8.
    """

    offset: int
    shape: tuple[int, ...]


def set_bytes(rig: CameraRig) -> int:
    """Number of bytes that the images of all cameras need."""
    sizes = (camera.size_px for camera in rig)
    return sum(_aligned(_CHANNELS * width * height) for width, height in sizes)


def put(
    memory: mmap.mmap, images: Mapping[str, Image], begin: int, end: int
) -> dict[str, Place] | None:
    """Copy images into a part of the memory; None if they do not fit into it.

    Images that lie in the memory already are not copied.
    """
    places = {}
    whole = np.frombuffer(memory, np.uint8)
    first = whole.ctypes.data
    for name, image in images.items():
        at = image.ctypes.data - first
        if 0 <= at < whole.size and image.flags.c_contiguous:
            places[name] = Place(at, image.shape)
            continue
        if begin + image.size > end:
            return None
        shared = np.frombuffer(memory, np.uint8, image.size, begin)
        np.copyto(shared.reshape(image.shape), image)
        places[name] = Place(begin, image.shape)
        begin += _aligned(image.size)
    return places


def get(memory: mmap.mmap, place: Place) -> Image:
    """The image at a place, without a copy."""
    size = int(np.prod(place.shape))
    return np.frombuffer(memory, np.uint8, size, place.offset).reshape(place.shape)


def _aligned(size: int) -> int:
    return -(-size // _ALIGNED) * _ALIGNED
