"""Reading a bag from within: what is counted, where reading begins, and without its index."""

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from markerless_tracker.bags import write_bag
from markerless_tracker.datasets import open_recording
from markerless_tracker.datasets.bag import stream
from markerless_tracker.datasets.bag.stream import McapFiles, RawMessage
from markerless_tracker.errors import DatasetError

STEP_NS = 16_666_667
SETS = 8


@pytest.fixture
def write(make_recording, tmp_path: Path) -> Callable[..., Path]:
    """`write(compress=)`: a bag of `SETS` sets whose images fill a chunk of the file each."""
    folder = make_recording(frames=SETS, size_px=(640, 480))

    def make(compress: str = "none") -> Path:
        write_bag(open_recording(folder), tmp_path / compress, compress=compress)
        return tmp_path / compress

    return make


@pytest.fixture
def read_messages(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Topics of all messages that any bag has read in full."""
    seen: list[str] = []
    original = McapFiles._messages

    def messages(self: McapFiles, number: int, offset: int) -> Iterator[RawMessage]:
        for message in original(self, number, offset):
            seen.append(message.topic)
            yield message

    monkeypatch.setattr(McapFiles, "_messages", messages)
    return seen


@pytest.mark.parametrize("compress", ["none", "zstd", "jpeg"])
def test_reading_from_within_gives_the_same_sets(write, compress: str) -> None:
    bag = write(compress)
    whole = list(open_recording(bag).frames())
    for start, every in ((1, 1), (5, 2), (SETS - 1, 1)):
        part = list(open_recording(bag).frames(start=start, every=every))
        assert [s.index for s in part] == list(range(start, SETS, every))
        for found in part:
            assert found.stamp_ns == whole[found.index].stamp_ns
            for name, image in found.images.items():
                np.testing.assert_array_equal(image, whole[found.index].images[name])


def test_opening_and_seeking_read_no_image(write, read_messages: list[str]) -> None:
    recording = open_recording(write())
    assert recording.start_index(6 * STEP_NS) == 6
    assert read_messages == []
    assert len(list(recording.frames(start=6))) == 2
    images = [topic for topic in read_messages if topic.endswith("image_raw")]
    # The chunk in which set 6 begins may hold the last image of set 5.
    assert 4 <= len(images) <= 5


def test_a_lost_image_is_counted_once(write, tmp_path: Path) -> None:
    bag = write()
    recording = open_recording(bag)
    original = recording._files.messages
    lost = 2  # the third image of cam02

    def messages(*place: object) -> Iterator[RawMessage]:
        seen = 0
        for message in original(*place):
            seen += message.topic == "/cam02/image_raw"
            if (message.topic, seen) != ("/cam02/image_raw", lost + 1):
                yield message

    recording._files.messages = messages
    recording._files.heads = lambda topics: (m for m in messages() if m.topic in topics)
    for frame in recording.frames():
        recording.start_index(frame.stamp_ns)
    assert recording.warnings == ("none: sets lacking a camera were skipped (missing: cam02 1)",)
    list(recording.frames())
    assert len(recording.warnings) == 1


def test_a_later_reading_replaces_the_counts_of_an_earlier_one(write) -> None:
    recording = open_recording(write())
    recording.warn("2 images lost", replaces="lost")
    recording.warn("other")
    recording.warn("3 images lost", replaces="lost")
    assert recording.warnings == ("3 images lost", "other")


def test_files_that_follow_each_other_are_one_bag(write, tmp_path: Path) -> None:
    first = write()
    whole = [s.stamp_ns for s in open_recording(first).frames()]
    later = open_recording(first)
    shifted = [
        type(s)(s.index, s.stamp_ns + SETS * STEP_NS, s.images) for s in later.frames(start=4)
    ]
    later._read = lambda start, every: iter(shifted)
    write_bag(later, tmp_path / "second")
    both = tmp_path / "both"
    both.mkdir()
    shutil.copy(first / "calibration.toml", both)
    shutil.copy(first / "none.mcap", both / "a.mcap")
    shutil.copy(tmp_path / "second" / "second.mcap", both / "b.mcap")
    recording = open_recording(both)
    expected = [*whole, *(s.stamp_ns for s in shifted)]
    assert [s.stamp_ns for s in recording.frames()] == expected
    assert recording.start_index(shifted[1].stamp_ns) == SETS + 1
    assert [s.stamp_ns for s in recording.frames(start=SETS + 1)] == expected[SETS + 1 :]
    with pytest.raises(DatasetError, match="has 12 frames"):
        recording.frames(start=12)


@pytest.mark.parametrize("good_chunks", [0, 3])
def test_a_wrong_index_is_replaced_by_reading_forward(
    write, monkeypatch: pytest.MonkeyPatch, good_chunks: int
) -> None:
    original = stream._heads
    calls = []

    def heads(*args):
        calls.append(args)
        if len(calls) > good_chunks:
            raise ValueError("no such record")
        return original(*args)

    bag = write()
    monkeypatch.setattr(stream, "_heads", heads)
    recording = open_recording(bag)
    calls.clear()
    assert recording.start_index(6 * STEP_NS) == 6
    assert [s.index for s in recording.frames(start=6)] == [6, 7]
