"""Bags cut at any byte: every message that is whole in the file is read, and nothing else."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from mcap.records import Chunk, Message
from mcap.stream_reader import StreamReader, breakup_chunk

from markerless_tracker.bags.mcap_bag import BagWriter
from markerless_tracker.bags.messages import image_message
from markerless_tracker.camera import write_calibration
from markerless_tracker.datasets import open_recording
from markerless_tracker.datasets.bag.stream import McapFiles
from markerless_tracker.errors import DatasetError

SETS = 20


@pytest.fixture(params=[False, True], ids=["raw", "zstd"])
def bag(request, make_recording, tmp_path: Path) -> Path:
    """A bag of several chunks, each of several messages."""
    rig = open_recording(make_recording(size_px=(32, 24))).rig
    folder = tmp_path / "bag"
    folder.mkdir()
    rng = np.random.default_rng(3)
    with BagWriter(folder, zstd=request.param, chunk_bytes=20_000) as writer:
        topics = {n: writer.topic(f"/{n}/image_raw", "sensor_msgs/msg/Image") for n in rig.names}
        for number in range(SETS):
            for camera in rig:
                image = rng.integers(0, 256, (24, 32, 3), dtype=np.uint8)
                stamp = number * 50_000_000
                writer.write(topics[camera.name], stamp, image_message(image, stamp, camera))
    write_calibration(folder / "calibration.toml", rig)
    return folder


def ends(content: bytes, path: Path) -> Iterator[tuple[int, bytes]]:
    """Data of every message, and the byte of the file behind the last that it needs."""
    with path.open("rb") as file:
        for record in StreamReader(file, emit_chunks=True).records:
            if not isinstance(record, Chunk):
                continue
            messages = [r for r in breakup_chunk(record) if isinstance(r, Message)]
            for message in messages:
                if record.compression:
                    end = content.index(record.data) + len(record.data)
                else:
                    end = content.index(message.data) + len(message.data)
                yield end, message.data


def test_two_hundred_cuts(bag: Path) -> None:
    file = next(bag.glob("*.mcap"))
    content = file.read_bytes()
    known = list(ends(content, file))
    assert len(known) == 2 * SETS
    whole = [image for frame in open_recording(bag).frames() for image in frame.images.values()]
    rng = np.random.default_rng(11)
    sets_read = set()
    for size in sorted(rng.integers(0, len(content), 100).tolist(), reverse=True):
        file.write_bytes(content[:size])
        intact = [data for end, data in known if end <= size]
        if size < 8:
            with pytest.raises(DatasetError, match="not an MCAP file"):
                McapFiles([file])
            continue
        messages = [message.data for message in McapFiles([file])]
        assert messages == [message.data for message in McapFiles([file], checked=False)]
        if b"zstd" in content:
            # Of a cut chunk what can be decompressed is read, too.
            assert messages[: len(intact)] == intact
            assert messages == [data for _, data in known][: len(messages)]
        else:
            assert messages == intact
        try:
            recording = open_recording(bag)
        except DatasetError as error:
            assert len(messages) < 2 and "\n" not in str(error)
            continue
        images = [image for frame in recording.frames() for image in frame.images.values()]
        assert len(images) == len(messages) // 2 * 2
        for got, sent in zip(images, whole, strict=False):
            np.testing.assert_array_equal(got, sent)
        sets_read.add(len(images) // 2)
        notes = [text for text in recording.warnings if "cut or damaged" in text]
        assert len(notes) == 1 and str(file) in notes[0]
    # A compressed chunk as small as these is read whole or not at all.
    assert len(sets_read) >= (4 if b"zstd" in content else 15)
