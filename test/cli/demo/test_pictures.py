"""What the demo reads out of a result."""

import json
from pathlib import Path

import pytest

from markerless_tracker.cli.demo.pictures import mean_overlap, read_outcome
from markerless_tracker.errors import DatasetError


def write(path: Path, frames: list[dict[str, object]]) -> None:
    path.write_text(json.dumps({"settings": {"body": "balan31"}, "frames": frames}))


def test_only_tracked_frames_count(tmp_path: Path) -> None:
    frames = [
        {"stamp_ns": 0, "state": "SEARCHING", "iou": {}},
        {"stamp_ns": 1, "state": "TRACKING", "iou": {"cam01": 0.5, "cam02": 0.25}},
        {"stamp_ns": 2, "state": "TRACKING", "iou": {"cam01": 1.0}},
        {"stamp_ns": 3, "state": "LOST", "iou": {"cam01": 0.0}},
    ]
    write(tmp_path / "run.v1.json", frames)
    outcome = read_outcome(tmp_path / "run.v1")
    found = outcome.frames
    assert outcome.body == "balan31"
    assert [frame["stamp_ns"] for frame in found] == [1, 2]
    assert mean_overlap(found) == {"cam01": 0.75, "cam02": 0.25}


@pytest.mark.parametrize("text", [None, "{}", "not json", '{"frames"'])
def test_no_result_is_one_line(tmp_path: Path, text: str | None) -> None:
    if text is not None:
        (tmp_path / "run.json").write_text(text)
    with pytest.raises(DatasetError, match="run.json: no result of a tracker") as caught:
        read_outcome(tmp_path / "run")
    assert "\n" not in str(caught.value)


def test_nobody_tracked_is_one_line(tmp_path: Path) -> None:
    write(tmp_path / "run.json", [{"stamp_ns": 0, "state": "LOST", "iou": {}}])
    with pytest.raises(DatasetError, match=r"run.json: .* in none of 1 frames"):
        read_outcome(tmp_path / "run")
