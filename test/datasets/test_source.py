"""Detecting the format of a recording."""

from pathlib import Path

import pytest

from markerless_tracker.datasets import detect_format, open_recording
from markerless_tracker.datasets.source import calibration_beside, trials_at
from markerless_tracker.errors import DatasetError


def test_unknown_formats_are_refused(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match="no such file or folder"):
        open_recording(tmp_path / "none")
    with pytest.raises(DatasetError, match="no recording; expected.*calibration.toml.*mcap"):
        open_recording(tmp_path)
    for number in (1, 2):
        (tmp_path / f"cam{number}.mp4").write_bytes(b"")
    with pytest.raises(DatasetError, match="2 videos, but no calibration.toml, which `calibrate`"):
        open_recording(tmp_path)
    (tmp_path / "file.txt").write_text("hello")
    with pytest.raises(DatasetError, match="no recording"):
        open_recording(tmp_path / "file.txt")
    with pytest.raises(DatasetError, match="'video'.*folder, pose2sim, humaneva, .*, bag"):
        open_recording(tmp_path, format="video")


def test_formats_are_detected(tmp_path: Path, make_recording) -> None:
    assert detect_format(make_recording()) == "folder"
    (tmp_path / "project" / "videos").mkdir(parents=True)
    assert detect_format(tmp_path / "project") is None
    (tmp_path / "project" / "Calibration").mkdir()
    assert detect_format(tmp_path / "project") == "pose2sim"
    (tmp_path / "bag").mkdir()
    (tmp_path / "bag" / "x.mcap").write_bytes(b"")
    assert detect_format(tmp_path / "bag") == detect_format(tmp_path / "bag" / "x.mcap") == "bag"


def test_calibrations_outside_of_a_recording_are_known(tmp_path: Path) -> None:
    take = tmp_path / "video" / "S1" / "acting1"
    take.mkdir(parents=True)
    (take / "TC_S1_acting1_cam1.mp4").write_bytes(b"")
    assert calibration_beside(take) is None
    (tmp_path / "calibration.cal").write_bytes(b"")
    assert calibration_beside(take) == tmp_path / "calibration.cal"
    session = tmp_path / "project" / "day"
    (session / "videos-raw").mkdir(parents=True)
    (session.parent / "calibration").mkdir()
    (session.parent / "calibration" / "calibration.toml").write_text("", encoding="utf-8")
    assert calibration_beside(session) == session.parent / "calibration" / "calibration.toml"
    # Its calibration has no camera: that is told by opening it.
    assert trials_at(session) == [session]
