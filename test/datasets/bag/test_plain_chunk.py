"""Uncompressed chunks read message by message give what the library gives, up to any damage."""

from pathlib import Path

import numpy as np
import pytest
from mcap.opcode import Opcode

from markerless_tracker.bags.mcap_bag import BagWriter
from markerless_tracker.datasets.bag.plain_chunk import plain_chunk
from markerless_tracker.datasets.bag.stream import MAGIC, McapFiles

MESSAGES = 12
DATA_BYTES = 500


def written(folder: Path, *, zstd: bool = False) -> Path:
    """A bag with two topics and several messages in each chunk."""
    folder.mkdir()
    rng = np.random.default_rng(5)
    with BagWriter(folder, zstd=zstd, chunk_bytes=2000) as writer:
        topics = [writer.topic(f"/cam0{n}/image_raw", "sensor_msgs/msg/Image") for n in (1, 2)]
        for number in range(MESSAGES):
            data = rng.integers(0, 256, DATA_BYTES, dtype=np.uint8).tobytes()
            writer.write_serialized(topics[number % 2], number * 1_000_000, data)
    return next(folder.glob("*.mcap"))


@pytest.mark.parametrize("zstd", [False, True])
def test_same_messages_with_and_without_checksums(tmp_path: Path, zstd: bool) -> None:
    file = written(tmp_path / "bag", zstd=zstd)
    checked, plain = McapFiles([file]), McapFiles([file], checked=False)
    messages = list(checked)
    assert len(messages) == MESSAGES
    assert list(plain) == messages
    assert plain.types == checked.types and plain.damage is None
    later = messages[MESSAGES // 2].place
    assert list(plain.messages(later)) == list(checked.messages(later))


def test_only_checked_reading_ends_at_a_wrong_byte(tmp_path: Path) -> None:
    file = written(tmp_path / "bag")
    messages = list(McapFiles([file]))
    content = bytearray(file.read_bytes())
    content[content.index(messages[5].data) + DATA_BYTES // 2] ^= 1
    file.write_bytes(content)
    checked, plain = McapFiles([file]), McapFiles([file], checked=False)
    assert len(list(checked)) < MESSAGES and checked.damage is not None
    played = list(plain)
    assert len(played) == MESSAGES and plain.damage is None
    assert [number for number in range(MESSAGES) if played[number] != messages[number]] == [5]


@pytest.mark.parametrize("seed", range(20))
def test_damaged_lengths_are_found(tmp_path: Path, seed: int) -> None:
    """Wrong bytes outside of the data end the reading or change one field, without any error."""
    file = written(tmp_path / "bag")
    messages = list(McapFiles([file]))
    content = bytearray(file.read_bytes())
    first = content.index(messages[4].data)
    rng = np.random.default_rng(seed)
    # Opcode, length, channel, sequence and times of a message.
    content[first - 1 - int(rng.integers(31))] = int(rng.integers(256))
    file.write_bytes(content)
    played = list(McapFiles([file], checked=False))
    known = {message.data for message in messages}
    assert {message.data for message in played[:4]} <= known
    assert len(played) <= MESSAGES


def test_no_plain_chunk(tmp_path: Path) -> None:
    plain, packed = written(tmp_path / "plain"), written(tmp_path / "packed", zstd=True)
    offset = next(iter(McapFiles([plain]))).place.offset
    with plain.open("rb") as file:
        chunk = plain_chunk(file, offset)
        assert chunk is not None and file.tell() == 0
        assert plain_chunk(file, 0) is None
        assert plain_chunk(file, len(MAGIC)) is None
        assert plain_chunk(file, plain.stat().st_size) is None
        assert plain.read_bytes()[offset] == Opcode.CHUNK
    with packed.open("rb") as file:
        assert plain_chunk(file, next(iter(McapFiles([packed]))).place.offset) is None
    plain.write_bytes(plain.read_bytes()[: chunk.end - 1])
    with plain.open("rb") as file:
        assert plain_chunk(file, offset) is None
