"""Whether the images of a video follow each other at a constant rate."""

import re
from pathlib import Path

import pytest

from markerless_tracker.datasets import open_recording
from markerless_tracker.datasets.video.pace import Pace


def paced(times_s: list[float], fps: float | None = 60.0) -> Pace:
    pace = Pace(fps)
    for time_s in times_s:
        pace.add(time_s)
    return pace


@pytest.mark.parametrize("fps", [60.0, 30000 / 1001, 59.997])
def test_times_rounded_to_ms_and_a_rounded_rate_are_even(fps: float) -> None:
    times = [round(1000 * index / fps) / 1000.0 + 0.5 for index in range(36000)]
    assert paced(times, fps).uneven is None
    assert paced(times, fps * 1.00005).uneven is None


def test_the_first_image_beside_the_rate_is_kept() -> None:
    times = [index / 60.0 + (0.1 if index >= 7 else 0.0) for index in range(20)]
    uneven = paced(times).uneven
    assert uneven is not None and uneven.frame == 7
    assert uneven.late_s == pytest.approx(0.1)


def test_unknown_times_and_rates_are_not_compared() -> None:
    assert paced([0.0] * 20).uneven is None
    assert paced([0.0, 5.0, 9.0], None).uneven is None


def delay(path: Path, first: int, by_ms: int) -> int:
    """Delay the images of a Matroska file from a number on; returns the number of its images.

    An image is a SimpleBlock (0xA3) with its size, the track 1 and its time in ms.
    """
    content = bytearray(path.read_bytes())
    blocks = list(re.finditer(rb"\xa3[\x40-\x7f].\x81([\x00-\x07].)[\x00\x80]", content, re.DOTALL))
    for block in blocks[first:]:
        time_ms = int.from_bytes(block[1], "big") + by_ms
        content[block.start(1) : block.end(1)] = time_ms.to_bytes(2, "big")
    path.write_bytes(content)
    return len(blocks)


@pytest.mark.parametrize(("start", "every"), [(0, 1), (1, 4)])
def test_a_recording_with_a_variable_rate_warns_once(make_recording, start, every) -> None:
    folder = make_recording(frames=20)
    assert delay(folder / "cam02.mkv", 5, 100) == 20
    recording = open_recording(folder)
    for _ in range(2):
        whole = list(recording.frames(start=start, every=every))
        assert whole[0].stamp_ns == round(start * 1e9 / 60)
    (warning,) = recording.warnings
    assert "small: cam02: variable frame rate: frame 5 is +100 ms beside" in warning
