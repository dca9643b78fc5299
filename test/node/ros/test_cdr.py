"""Serialised images: the same fields as rclpy reads, nothing beyond the message, one memory."""

import struct
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("rclpy", reason="ROS 2 is not installed")

from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import CameraInfo, CompressedImage, Image
from std_msgs.msg import Header

from markerless_tracker.errors import ImageError
from markerless_tracker.node.ros.cdr import (
    ImageMessage,
    image_bytes,
    read_compressed,
    read_image,
    with_stamp,
    without_stamp,
)
from markerless_tracker.node.ros.images import decode_image
from markerless_tracker.node.ros.stamps import stamp_of, time_message

STAMP_NS = 1_700_000_000_123_456_789


def made(frame: str, encoding: str, width: int, height: int, step: int, size: int) -> Image:
    data = np.random.default_rng(size).integers(0, 256, size, dtype=np.uint8)
    return Image(
        header=Header(stamp=time_message(STAMP_NS), frame_id=frame), width=width, height=height,
        encoding=encoding, step=step, data=data.tobytes(),
    )  # fmt: skip


@given(
    st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=12),
    st.sampled_from(["", "mono8", "bgr8", "rgba8", "16UC1"]),
    st.integers(0, 2**32 - 1),
    st.integers(0, 2**32 - 1),
    st.integers(0, 2**32 - 1),
    st.integers(0, 70),
)
def test_every_field_as_rclpy_writes_it(
    frame: str, encoding: str, width: int, height: int, step: int, size: int
) -> None:
    message = made(frame, encoding, width, height, step, size)
    image = read_image(serialize_message(message), "cam01/image_raw")
    assert (image.stamp_ns, image.frame_id, image.encoding) == (STAMP_NS, frame, encoding)
    assert (image.width, image.height, image.step) == (width, height, step)
    np.testing.assert_array_equal(image.data, np.array(message.data, np.uint8))


def test_a_stamp_before_the_epoch() -> None:
    message = made("a", "mono8", 2, 1, 2, 2)
    message.header.stamp = time_message(-1)
    assert read_image(serialize_message(message), "a").stamp_ns == -1


def test_big_endian() -> None:
    head = b"\0\0\0\0" + struct.pack(">iI", 1, 2) + struct.pack(">I", 2) + b"f\0" + b"\0\0"
    head += struct.pack(">II", 1, 3) + struct.pack(">I", 6) + b"mono8\0" + b"\0\0"
    message = head + struct.pack(">II", 3, 3) + b"abc"
    image = read_image(message, "a")
    assert (image.stamp_ns, image.frame_id, image.encoding) == (10**9 + 2, "f", "mono8")
    assert (image.height, image.width, image.step) == (1, 3, 3) and bytes(image.data) == b"abc"


def test_the_image_shares_the_messages_memory_and_is_not_marked_read_only() -> None:
    message = serialize_message(made("cam", "bgr8", 4, 3, 12, 36))
    image = decode_image(read_image(message, "a"), "a")
    assert np.shares_memory(image, np.frombuffer(message, np.uint8))
    assert image.flags.writeable and image.flags.c_contiguous and image.shape == (3, 4, 3)
    expected = bytes(image)
    del message
    assert bytes(image) == expected


def test_every_cut_is_one_line() -> None:
    message = serialize_message(made("cam01_optical_frame", "bgr8", 4, 3, 12, 36))
    whole = read_image(message, "a")
    least = len(message) - (len(message) - 4) % 4
    for size in range(len(message)):
        try:
            image = read_image(message[:size], "cam01/image_raw")
        except ImageError as error:
            assert str(error).startswith("cam01/image_raw: ") and "\n" not in str(error)
        else:
            assert size >= least - 4 and bytes(image.data) == bytes(whole.data)


@given(st.binary(max_size=120), st.booleans())
def test_any_bytes_give_an_image_or_one_line(data: bytes, plain: bool) -> None:
    try:
        image = read_image(b"\0\1\0\0" + data if plain else data, "a")
    except ImageError as error:
        assert "\n" not in str(error) and len(str(error)) < 200
    else:
        assert isinstance(image, ImageMessage) and image.data.size <= len(data)


def test_a_compressed_image_as_rclpy_writes_it() -> None:
    data = cv2.imencode(".jpg", np.zeros((3, 5), np.uint8))[1].tobytes()
    message = CompressedImage(
        header=Header(stamp=time_message(STAMP_NS), frame_id="cam"), format="jpeg", data=data
    )
    serialised = serialize_message(message)
    image = read_compressed(serialised, "a")
    assert (image.stamp_ns, image.frame_id, image.format) == (STAMP_NS, "cam", "jpeg")
    assert (image.width, image.height, image.channels) == (5, 3, 1)
    assert bytes(image.data) == data
    assert np.shares_memory(image.data, np.frombuffer(serialised, np.uint8))
    message.data = b"no image"
    with pytest.raises(ImageError, match="cam01/x: .*8 bytes, expected a JPEG or PNG"):
        read_compressed(serialize_message(message), "cam01/x")
    for size in range(40):
        with pytest.raises(ImageError):
            read_compressed(serialised[:size], "a")


@pytest.mark.parametrize("shape", [(3, 5), (3, 5, 3)])
def test_what_is_written_is_what_rclpy_reads(shape: tuple[int, ...]) -> None:
    picture = np.arange(np.prod(shape), dtype=np.uint8).reshape(shape)
    for frame in ("", "a", "ab", "abc", "cam01_optical_frame"):
        message: Any = deserialize_message(image_bytes(picture, STAMP_NS, frame), Image)
        assert (stamp_of(message), message.header.frame_id) == (STAMP_NS, frame)
        assert message.encoding == ("mono8" if picture.ndim == 2 else "bgr8")
        np.testing.assert_array_equal(decode_image(message, "a"), picture)


@pytest.mark.parametrize("bad", [np.zeros((2, 2, 4), np.uint8), np.zeros((2, 2)), np.zeros((0, 2))])
def test_what_is_no_image_is_refused(bad: Any) -> None:
    with pytest.raises(ImageError, match="is no image"):
        image_bytes(bad, 0, "a")


def test_a_stamp_is_replaced_and_left_out() -> None:
    first = serialize_message(CameraInfo(width=7, d=[0.5]))
    second = with_stamp(first, STAMP_NS)
    message: Any = deserialize_message(second, CameraInfo)
    assert stamp_of(message) == STAMP_NS and message.width == 7 and list(message.d) == [0.5]
    assert without_stamp(first) == without_stamp(second) != without_stamp(with_stamp(first, 0)[:-1])
