import array
import dataclasses
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from markerless_tracker.datasets.bag.encodings import compressed_layout
from markerless_tracker.errors import ImageError
from markerless_tracker.node.ros.cdr import CompressedMessage
from markerless_tracker.node.ros.images import (
    check_layout,
    decode_image,
    decode_received,
    fill_image,
    received_channels,
)

CHANNELS = {"mono8": 1, "8UC1": 1, "bgr8": 3, "8UC3": 3, "rgb8": 3, "bgra8": 4, "rgba8": 4}


def message(encoding: str, width: int, height: int, step: int, data: bytes) -> Any:
    return SimpleNamespace(
        encoding=encoding, width=width, height=height, step=step, data=array.array("B", data),
        is_bigendian=1,
    )  # fmt: skip


@settings(max_examples=100, deadline=None)
@given(
    st.sampled_from(sorted(CHANNELS)),
    st.integers(1, 7),
    st.integers(1, 5),
    st.integers(0, 5),
    st.integers(0, 2**32 - 1),
)
def test_every_encoding_and_padding(
    encoding: str, width: int, height: int, padding: int, seed: int
) -> None:
    channels = CHANNELS[encoding]
    pixels = np.random.default_rng(seed).integers(0, 256, (height, width, channels), dtype=np.uint8)
    step = width * channels + padding
    rows = np.full((height, step), 77, dtype=np.uint8)
    rows[:, : width * channels] = pixels.reshape(height, -1)
    image = decode_image(message(encoding, width, height, step, rows.tobytes()), "a/image_raw")
    expected = pixels[..., 0] if channels == 1 else pixels[..., :3]
    if encoding.startswith("rgb"):
        expected = expected[..., ::-1]
    np.testing.assert_array_equal(image, expected)
    assert image.flags.c_contiguous and image.dtype == np.uint8


@pytest.mark.parametrize("encoding", ["bgr8", "mono8"])
def test_plain_images_share_the_message_memory(encoding: str) -> None:
    channels = CHANNELS[encoding]
    came = message(encoding, 6, 4, 6 * channels, bytes(24 * channels))
    image = decode_image(came, "a/image_raw")
    came.data[0] = 201
    assert image.flat[0] == 201


@pytest.mark.parametrize(
    ("encoding", "width", "height", "step", "size"),
    [
        ("bgr8", 4, 2, 12, 23),
        ("bgr8", 4, 2, 12, 25),
        ("bgr8", 4, 2, 11, 22),
        ("bgr8", 0, 2, 0, 0),
        ("mono8", 4, 0, 4, 0),
        ("rgba8", 4, 2, 12, 24),
        ("mono8", 2**31, 2**31, 2**31, 16),
    ],
)
def test_inconsistent_sizes_name_topic_and_sizes(
    encoding: str, width: int, height: int, step: int, size: int
) -> None:
    came = message(encoding, width, height, step, bytes(size))
    with pytest.raises(ImageError, match=rf"cam07/image_raw: {size} bytes.*{width}x{height}"):
        decode_image(came, "cam07/image_raw")


@pytest.mark.parametrize("encoding", ["", "mono16", "bayer_rggb16", "nv21", "32FC1"])
def test_unknown_encodings_name_themselves_and_the_known(encoding: str) -> None:
    with pytest.raises(ImageError, match=rf"cam07/image_raw: .*'{encoding}'.*bgr8") as error:
        check_layout(message(encoding, 4, 2, 12, bytes(24)), "cam07/image_raw")
    assert "\n" not in str(error.value)


def compressed(end: str, picture: Any, **instead: Any) -> CompressedMessage:
    data = np.frombuffer(cv2.imencode(end, picture)[1].tobytes(), np.uint8)
    layout = compressed_layout(data, where="a")._asdict() | instead
    return CompressedMessage(0, "", end, data, **layout)


@pytest.mark.parametrize("shape", [(5, 7), (5, 7, 3)])
def test_compressed_images_are_decoded(shape: tuple[int, ...]) -> None:
    picture = np.random.default_rng(1).integers(0, 256, shape, dtype=np.uint8)
    came = compressed(".png", picture)
    assert received_channels(came) == (3 if len(shape) == 3 else 1)
    np.testing.assert_array_equal(decode_received(came, "a"), picture)
    smooth = np.full(shape, 130, np.uint8)
    assert np.abs(decode_received(compressed(".jpg", smooth), "a").astype(int) - 130).max() < 4


def test_a_compressed_image_that_contradicts_its_header_is_refused() -> None:
    picture = np.zeros((5, 7, 3), np.uint8)
    with pytest.raises(ImageError, match="a/x: an image of 7x5 px came, its header says 8x5 px"):
        decode_received(compressed(".png", picture, width=8), "a/x")
    cut = compressed(".png", picture)
    with pytest.raises(ImageError, match="a/x: .*cannot be decoded"):
        decode_received(dataclasses.replace(cut, data=cut.data[:30]), "a/x")


@pytest.mark.parametrize("shape", [(5, 7), (5, 7, 3)])
@pytest.mark.parametrize("strided", [False, True])
def test_round_trip_through_a_real_message(shape: tuple[int, ...], strided: bool) -> None:
    from sensor_msgs.msg import Image

    image = np.random.default_rng(1).integers(0, 256, shape, dtype=np.uint8)
    image = image[::2, ::2] if strided else image
    filled = fill_image(Image(), image, "a")
    assert filled.encoding == ("mono8" if image.ndim == 2 else "bgr8")
    assert isinstance(filled.data, array.array)
    np.testing.assert_array_equal(decode_image(filled, "a"), image)


@pytest.mark.parametrize(
    "image",
    [
        np.zeros((4, 4, 2), np.uint8),
        np.zeros((4, 4), np.float32),
        np.zeros((0, 4), np.uint8),
        np.zeros(4, np.uint8),
    ],
)
def test_only_images_can_be_sent(image: Any) -> None:
    with pytest.raises(ImageError, match="debug/a/overlay"):
        fill_image(SimpleNamespace(), image, "debug/a/overlay")
