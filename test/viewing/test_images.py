"""The images of a result, found by time."""

import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from markerless_tracker.bags import write_bag
from markerless_tracker.datasets import open_recording
from markerless_tracker.datasets.part import PartRecording
from markerless_tracker.errors import DatasetError
from markerless_tracker.results.read import read_result
from markerless_tracker.viewing.images import ResultImages


def indices(images: ResultImages, rows: list[int]) -> list[tuple[int, int]]:
    return [(row, frame.index) for row, frame in images.frames(rows)]


def test_rows_come_with_the_images_of_their_time(make_result, walk: Path) -> None:
    result = read_result(make_result(source=walk))
    images = ResultImages(result, width_px=96)
    assert images.rig["cam01"].size_px == (96, 72)
    assert indices(images, [0, 1, 2, 3, 4, 5]) == [(i, i) for i in range(6)]
    assert indices(images, [1, 3, 5]) == [(1, 1), (3, 3), (5, 5)]
    assert indices(images, [0, 1, 4]) == [(0, 0), (1, 1), (4, 4)]
    assert indices(images, [5]) == [(5, 5)] and indices(images, []) == []


def test_the_source_may_be_elsewhere(make_result, walk: Path) -> None:
    result = read_result(make_result(source="/nowhere/walk"))
    with pytest.raises(DatasetError, match="/nowhere/walk: the images .* --source"):
        ResultImages(result)
    with pytest.raises(
        DatasetError, match="/nowhere/given: the images of the result are not there"
    ):
        ResultImages(result, Path("/nowhere/given"))
    with pytest.raises(DatasetError, match="the result names no source, expected .* --source"):
        ResultImages(read_result(make_result("unnamed", source="")))
    assert len(indices(ResultImages(result, walk), [0, 5])) == 2


def test_rows_beyond_the_recording_are_left_out(make_result, walk: Path) -> None:
    result = read_result(make_result(frames=8, source=walk))
    assert indices(ResultImages(result), [4, 5, 6, 7]) == [(4, 4), (5, 5)]


def test_rows_before_the_source_begins_are_left_out(
    make_result, walk: Path, tmp_path: Path
) -> None:
    result = read_result(make_result(source=walk))
    later = PartRecording(open_recording(walk), from_s=float(result.stamps_ns[2]) / 1e9)
    write_bag(later, tmp_path / "later")
    found = indices(ResultImages(result, tmp_path / "later"), [0, 1, 2, 4])
    assert [row for row, _ in found] == [2, 4]
    with pytest.raises(DatasetError, match="no frame within half a frame of 0.000000 s"):
        indices(ResultImages(result, tmp_path / "later"), [0, 1])


def test_cameras_are_brought_into_step_as_the_run_did(make_result, walk: Path) -> None:
    offsets = {"time_offsets_s": {"cam02": 1 / 30}}
    result = read_result(make_result(source=walk, notes=offsets))
    late = dict(ResultImages(result).frames([1, 2]))
    plain = dict(ResultImages(read_result(make_result("plain", source=walk))).frames([0, 1, 2]))
    assert (late[2].images["cam02"] == plain[1].images["cam02"]).all()
    assert (late[2].images["cam01"] == plain[2].images["cam01"]).all()


def test_cameras_are_shifted_as_the_run_shifted_them(make_result, walk: Path) -> None:
    entry = {"shift_px": [4.0, -2.0], "corrected": True}
    notes = {"scale": 0.5, "cameras": {"cam02": entry, "cam01": {**entry, "corrected": False}}}
    shifted = ResultImages(read_result(make_result(source=walk, notes=notes)), width_px=96).rig
    plain = ResultImages(read_result(make_result("plain", source=walk)), width_px=96).rig
    full_px = open_recording(walk).rig["cam02"].size_px[0]
    moved = shifted["cam02"].matrix[:2, 2] - plain["cam02"].matrix[:2, 2]
    np.testing.assert_allclose(moved, np.array([8.0, -4.0]) * 96 / full_px)
    np.testing.assert_array_equal(shifted["cam01"].matrix, plain["cam01"].matrix)


@pytest.mark.parametrize(
    "notes",
    [
        {"cameras": {"cam02": {"corrected": True}}},
        {"cameras": {"cam02": {"corrected": True, "shift_px": [1.0]}}},
        {"cameras": {"cam02": {"corrected": True, "shift_px": "ab"}}},
        {"cameras": ["cam02"]},
        {"scale": "half"},
    ],
)
def test_impossible_shifts_are_refused(make_result, walk: Path, notes) -> None:
    with pytest.raises(DatasetError, match="expected a factor, and `shift_px`"):
        ResultImages(read_result(make_result(source=walk, notes=notes)))


def test_a_bag_with_a_missing_set(make_result, walk: Path, tmp_path: Path) -> None:
    recording = open_recording(walk)
    sets = [images for images in recording.frames() if images.index != 1]
    recording.frames = lambda **_: iter(sets)  # type: ignore[method-assign]
    write_bag(recording, tmp_path / "bag")
    result = read_result(make_result(source=tmp_path / "bag"))
    shown = dict(ResultImages(result).frames([0, 2, 4]))
    assert {row: images.stamp_ns for row, images in shown.items()} == {
        row: int(result.stamps_ns[row]) for row in (0, 2, 4)
    }


def test_the_recording_is_read_as_the_run_read_it(make_result, walk: Path, tmp_path: Path) -> None:
    in_mm, bag = tmp_path / "mm", tmp_path / "bag"
    shutil.copytree(walk, in_mm)
    text = (in_mm / "calibration.toml").read_text()
    numbers = re.compile(r"translation = \[([^\]]*)\]")
    text = numbers.sub(
        lambda m: f"translation = {[1000.0 * float(v) for v in m[1].split(',')]}", text
    )
    (in_mm / "calibration.toml").write_text(text)
    options = {"format": None, "input_fps": None, "up": "z", "units": "mm"}
    write_bag(open_recording(in_mm, units="mm"), bag)
    result = read_result(make_result(source=in_mm, notes={"reading": options}))
    expected = open_recording(walk).rig["cam02"].T_world_cam
    for source in (None, in_mm, bag):
        found = ResultImages(result, source).rig["cam02"].T_world_cam
        np.testing.assert_allclose(found, expected, atol=1e-9)


@pytest.mark.parametrize("reading", [7, {"units": 3}, {"scale": 0.5}])
def test_impossible_options_of_the_run_are_refused(make_result, walk: Path, reading) -> None:
    result = read_result(make_result(source=walk, notes={"reading": reading}))
    with pytest.raises(DatasetError, match="`reading` is .*, expected some of format, input_fps"):
        ResultImages(result)
