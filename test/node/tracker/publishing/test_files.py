"""The result files of a node: an earlier result is kept, and trouble does not stop the tracker."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from markerless_tracker.body import BodyModel, load_body, markers
from markerless_tracker.errors import DatasetError
from markerless_tracker.records import TrackResult, TrackState
from markerless_tracker.tracking import TrackerConfig

pytest.importorskip("sensor_msgs.msg", reason="ROS 2 is not installed")

from markerless_tracker.node.tracker.publishing.files import ResultFile


@pytest.fixture(scope="module")
def body() -> BodyModel:
    return load_body("person31", 1.75)


def begun(name: Path, body: BodyModel, told: list[str], **options: Any) -> ResultFile:
    file = ResultFile(name, **{"overwrite": False, **options}, report=told.append)
    file.begin(SimpleNamespace(body=body, config=TrackerConfig()))  # type: ignore[arg-type]
    return file


def tracked(body: BodyModel, stamp_ns: int) -> TrackResult:
    pose = body.neutral
    return TrackResult(stamp_ns, TrackState.TRACKING, pose, markers(body, pose), 0.1, {}, 0)


def test_two_trackers_with_one_name_do_not_overwrite_each_other(
    body: BodyModel, tmp_path: Path
) -> None:
    """Both were started before either had written a frame."""
    told: list[str] = []
    first, second = (begun(tmp_path / "walk", body, told) for _ in range(2))
    for stamp_ns in range(5):
        first.add(tracked(body, stamp_ns), body)
    for stamp_ns in range(3):
        second.add(tracked(body, stamp_ns), body)
    assert len(told) == 1
    assert "result_file: " in told[0] and "walk.trc: exists already" in told[0]
    assert "no frame is written" in told[0] and "tracking goes on" in told[0]
    with pytest.raises(DatasetError, match="walk.trc: exists already"):
        second.close({})
    assert "5 frames written" in str(first.close({}))


def test_a_folder_that_cannot_be_made_any_more_is_told_and_tried_again(
    body: BodyModel, tmp_path: Path
) -> None:
    told: list[str] = []
    folder = tmp_path / "results"
    file = begun(folder / "walk", body, told)
    folder.rmdir()
    folder.write_text("in the way")
    for stamp_ns in range(2):
        file.add(tracked(body, stamp_ns), body)
    assert len(told) == 1 and "result_file: " in told[0] and "results" in told[0]
    folder.unlink()
    file.add(tracked(body, 2), body)
    assert "is written again" in told[1]
    assert "1 frames written" in str(file.close({}))
