"""Cameras that began at different times."""

from pathlib import Path

import numpy as np
import pytest

from markerless_tracker.datasets import open_recording, write_image
from markerless_tracker.datasets.empty_scene import backgrounds_of
from markerless_tracker.datasets.in_step import InStepRecording, read_time_offsets
from markerless_tracker.datasets.part import PartRecording
from markerless_tracker.errors import ConfigError, DatasetError


@pytest.mark.parametrize(
    ("offsets", "indices", "behind"),
    [
        ({}, range(12), {}),
        ({"cam02": 3 / 60}, range(3, 12), {"cam02": 3}),
        ({"cam01": -2 / 60}, range(10), {"cam01": -2}),
        ({"cam01": -1 / 60, "cam02": 2 / 60}, range(2, 11), {"cam01": -1, "cam02": 2}),
        ({"cam01": 2 / 60, "cam02": 3 / 60}, range(3, 14), {"cam01": 2, "cam02": 3}),
    ],
)
def test_each_camera_shows_its_frame_of_that_time(make_recording, offsets, indices, behind) -> None:
    stored = open_recording(make_recording(frames=12))
    kept = [frame.images for frame in stored.frames()]
    recording = InStepRecording(stored, offsets)
    found = list(recording.frames())
    assert [frame.index for frame in found] == list(indices)
    assert recording.frame_count == indices.stop
    for frame in found:
        assert frame.stamp_ns == pytest.approx(frame.index * 1e9 / 60, abs=2)
        for camera, image in frame.images.items():
            np.testing.assert_array_equal(image, kept[frame.index - behind.get(camera, 0)][camera])
    later = [frame.index for frame in recording.frames(start=5, every=3)]
    assert later == list(range(5, indices.stop, 3))
    assert recording.start_index(round(6e9 / 60)) == 6
    assert set(recording.background_frames()) == {"cam01", "cam02"}


def test_masks_belong_to_the_sets_that_show_their_frames(make_recording) -> None:
    folder = make_recording(frames=12)
    mask = np.full((48, 64), 255, np.uint8)
    for name in ("cam01", "cam02"):
        write_image(folder / "masks" / name / "000004.png", mask)
    recording = InStepRecording(open_recording(folder), {"cam02": 3 / 60})
    assert [list(recording.masks(name)) for name in ("cam01", "cam02")] == [[4], [7]]
    assert recording.stored_index("cam02", 7) == recording.stored_index("cam01", 4) == 4


def test_a_start_before_the_late_camera_is_refused(make_recording) -> None:
    recording = InStepRecording(open_recording(make_recording(frames=12)), {"cam02": 3 / 60})
    with pytest.raises(DatasetError, match="no frame within half a frame"):
        recording.start_index(0)


def test_what_remains_of_an_offset_is_reported(make_recording) -> None:
    stored = open_recording(make_recording(frames=12))
    assert not InStepRecording(stored, {"cam02": 3.1 / 60}).warnings
    (warning,) = InStepRecording(stored, {"cam02": 3.4 / 60}).warnings
    assert "up to 6.7 ms remain" in warning


def test_impossible_offsets(make_recording, tmp_path: Path) -> None:
    stored = open_recording(make_recording())
    with pytest.raises(ConfigError, match="no camera cam07, expected cam01, cam02"):
        InStepRecording(stored, {"cam07": 0.1})
    for camera in ("cam01", "cam02"):
        for wrong in (100.0, float("nan"), float("inf")):
            with pytest.raises(
                ConfigError, match=f"{camera} {wrong:g}; expected differences of at"
            ):
                InStepRecording(stored, {camera: wrong})
    for apart in (10.0, -10.0):
        with pytest.raises(ConfigError, match="share no time in .* of 0.1 s"):
            InStepRecording(stored, {"cam02": apart})
    assert read_time_offsets("cam01=0.5,cam02=-0.1") == {"cam01": 0.5, "cam02": -0.1}
    path = tmp_path / "offsets.yaml"
    path.write_text("cam01: 0.5\n", encoding="utf-8")
    assert read_time_offsets(str(path)) == {"cam01": 0.5}
    path.write_text("- 1\n", encoding="utf-8")
    deep = tmp_path / "deep.yaml"
    deep.write_text("[" * 5000, encoding="utf-8")
    for text in ("cam01", "cam01=x", str(path), str(deep), str(tmp_path / "none.yaml")):
        with pytest.raises(ConfigError, match="time offsets"):
            read_time_offsets(text)


def test_the_background_of_a_part_is_learned_from_the_whole(make_recording) -> None:
    """At the end of a recording a person may stand where they stood nowhere else."""
    stored = open_recording(make_recording(frames=60, backgrounds=0))
    part = PartRecording(stored, cameras=["cam02"], from_s=50 / 60)
    whole, own = backgrounds_of(stored), backgrounds_of(part)
    assert list(own) == ["cam02"]
    np.testing.assert_array_equal(own["cam02"], whole["cam02"])


def test_a_part_begins_at_its_time(make_recording) -> None:
    stored = open_recording(make_recording(frames=12))
    part = PartRecording(stored, from_s=4 / 60, until_s=8 / 60)
    assert [frame.index for frame in part.frames()] == list(range(4, 9))
    assert [frame.index for frame in part.frames(start=6, every=2)] == [6, 8]
