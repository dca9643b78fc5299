"""The demo end to end, short and on a synthetic person: real processes, real middleware."""

import re
import sys
from pathlib import Path

import pytest

from markerless_tracker.cli.demo import __main__ as demo
from markerless_tracker.cli.demo import scene
from markerless_tracker.datasets import read_trc
from markerless_tracker.errors import DatasetError

pytest.importorskip("rclpy", reason="the demo runs over ROS 2")


def no_index(folder: Path) -> Path:
    raise DatasetError("pose2sim==0.10.49 cannot be downloaded: no network")


def test_without_the_recording_a_synthetic_person_is_tracked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(scene, "fetch_recording", no_index)
    monkeypatch.setattr(scene, "MADE_UP_SECONDS", 0.2)
    assert demo.main(["--folder", str(tmp_path)]) == 0, capsys.readouterr().err
    out = capsys.readouterr().out
    assert "cannot be downloaded: no network\nThe demo uses a synthetic person" in out
    overlaps = re.findall(r"cam\d\d (\d\.\d+)", out)
    assert len(overlaps) == 4
    assert min(map(float, overlaps)) > 0.8
    track = read_trc(tmp_path / "result" / "every_frame.trc")
    # Lockstep: no set is skipped, however slow the machine is.
    assert len(track) == 12 and track.tracked.sum() == 12
    assert len(list((tmp_path / "result" / "overlays").glob("cam0[1-4]_*.png"))) == 12
    assert (tmp_path / "result" / "real_time.json").is_file()


def test_without_ros_it_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "rclpy", None)
    assert demo.main(["--folder", str(tmp_path), "--made-up"]) == 1
    err = capsys.readouterr().err
    assert err.startswith("demo: error: ROS 2 is not installed")
    assert err.count("\n") == 1
