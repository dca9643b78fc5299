"""A part of a recording reads its own cameras only."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from markerless_tracker.datasets import open_recording
from markerless_tracker.datasets.part import PartRecording
from markerless_tracker.errors import DatasetError


@pytest.fixture
def uneven(make_recording) -> Path:
    """A recording of 6 frames; cam02 has 4."""
    folder = Path(make_recording(frames=6))
    shutil.copy(make_recording("short", frames=4) / "cam02.mkv", folder / "cam02.mkv")
    return folder


def test_a_shorter_camera_that_is_left_out_does_not_end_it(uneven: Path) -> None:
    whole = open_recording(uneven)
    part = PartRecording(whole, cameras=["cam01"])
    assert part.frame_count == 6 and part.warnings == ()
    sets = list(part.frames())
    assert [s.index for s in sets] == list(range(6))
    assert [list(s.images) for s in sets] == [["cam01"]] * 6
    for own, one in zip(sets, whole.frames(), strict=False):
        np.testing.assert_array_equal(own.images["cam01"], one.images["cam01"])
    # The whole is as it was.
    assert whole.frame_count == 4 and "cam01 6, cam02 4" in whole.warnings[0]


def test_a_shorter_camera_that_is_kept_ends_it(uneven: Path) -> None:
    part = PartRecording(open_recording(uneven), cameras=["cam02", "cam01"])
    assert part.frame_count == 4 and len(list(part.frames())) == 4
    assert len(part.warnings) == 1 and "cam01 6, cam02 4" in part.warnings[0]


def test_its_time_may_lie_after_the_end_of_a_camera_that_is_left_out(uneven: Path) -> None:
    whole = open_recording(uneven)
    late_s = 5 / whole.fps
    part = PartRecording(whole, cameras=["cam01"], from_s=late_s, until_s=late_s)
    assert (part.first, part.frame_count) == (5, 6)
    assert [s.index for s in part.frames()] == [5]
    with pytest.raises(DatasetError, match=r"ends 0\.\d+ s after its first set"):
        PartRecording(whole, from_s=late_s)


def test_cameras_that_are_left_out_are_not_read(make_recording) -> None:
    folder = make_recording(frames=5)
    whole = open_recording(folder)
    (folder / "cam02.mkv").unlink()
    part = PartRecording(whole, cameras=["cam01"])
    assert len(list(part.frames())) == 5
    assert list(part.background_frames()) == ["cam01"]


def test_what_reading_finds_is_told(make_recording) -> None:
    folder = make_recording(frames=30)
    content = (folder / "cam02.mkv").read_bytes()
    (folder / "cam02.mkv").write_bytes(content[: len(content) // 2])
    part = PartRecording(open_recording(folder), cameras=["cam02"])
    assert 0 < len(list(part.frames())) < 30
    assert any("cam02 cannot be read beyond" in warning for warning in part.warnings)
