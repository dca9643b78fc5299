"""The bytes of bags are those of the writer of the mcap library and of rosbags."""

import io
from array import array
from typing import Any

import numpy as np
import pytest
from mcap.writer import CompressionType, Writer

from markerless_tracker.bags.messages import (
    encoded_message,
    image_message,
    serialized,
    typestore,
)
from markerless_tracker.bags.pieces import PieceWriter
from markerless_tracker.synthesis import SyntheticScene

CHUNK = 5000


def written(writer: Writer, file: io.BytesIO, messages: list[tuple[int, int, Any]]) -> bytes:
    writer.start(profile="ros2", library="tested")
    schema = writer.register_schema("a/b", "ros2msg", b"float64 x\n")
    first = writer.register_channel("/first", "cdr", schema, {"key": "välue"})
    for place, (channel, stamp, data) in enumerate(messages):
        if place == len(messages) // 2:
            writer.register_schema("c/d", "ros2msg", bytes(CHUNK))
            writer.register_channel("/late", "cdr", 2, {})
            writer.add_metadata("between", {"a": "b"})
        if place == len(messages) // 3:
            writer.flush()
        writer.add_message(first + channel, stamp, data, stamp, place)
    writer.add_metadata("last", {})
    writer.finish()
    return file.getvalue()


def by_the_library(messages: list[tuple[int, int, bytes]], *, zstd: bool) -> bytes:
    kind = CompressionType.ZSTD if zstd else CompressionType.NONE
    file = io.BytesIO()
    return written(Writer(file, chunk_size=CHUNK, compression=kind), file, messages)


def in_pieces(messages: list[tuple[int, int, bytes]], *, zstd: bool) -> bytes:
    cut = [
        (channel, stamp, (data[: len(data) // 3], memoryview(array("B", data[len(data) // 3 :]))))
        for channel, stamp, data in messages
    ]
    file = io.BytesIO()
    return written(PieceWriter(file, zstd=zstd, chunk_bytes=CHUNK), file, cut)


@pytest.mark.parametrize("zstd", [False, True], ids=["plain", "zstd"])
@pytest.mark.parametrize("count", [0, 1, 40])
def test_the_file_is_that_of_the_library(zstd: bool, count: int) -> None:
    rng = np.random.default_rng(count)
    messages = []
    for place in range(count):
        channel = int(rng.integers(2)) if place > count // 2 else 0
        # Stamps in any order, messages from nothing to more than a chunk.
        stamp = int(rng.integers(10**12))
        messages.append((channel, stamp, rng.bytes(int(rng.choice([0, 7, 900, 2 * CHUNK])))))
    assert in_pieces(messages, zstd=zstd) == by_the_library(messages, zstd=zstd)


@pytest.mark.parametrize("channels", [1, 3], ids=["mono8", "bgr8"])
def test_images_in_pieces_are_those_of_rosbags(channels: int) -> None:
    camera = next(iter(SyntheticScene(size_px=(64, 48)).rig))
    shape = (48, 64, channels) if channels == 3 else (48, 64)
    image = np.random.default_rng(0).integers(256, size=shape, dtype=np.uint8)
    for message in (image_message(image, 5, camera), encoded_message(image, 5, camera, "png")):
        parts = serialized(message, message.__msgtype__)
        assert len(parts) == 2
        whole = typestore().serialize_cdr(message, message.__msgtype__)
        assert b"".join(map(bytes, parts)) == bytes(whole)


def test_images_are_not_copied() -> None:
    camera = next(iter(SyntheticScene(size_px=(64, 48)).rig))
    image = np.zeros((48, 64, 3), np.uint8)
    _, data = serialized(image_message(image, 5, camera), "sensor_msgs/msg/Image")
    assert np.shares_memory(np.asarray(data), image)
