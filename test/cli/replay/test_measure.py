"""`benchmark live` end to end on a short made-up recording: real processes, real middleware."""

import json
import sys
from pathlib import Path

import pytest

from markerless_tracker.cli.main import main

# The tests below assert no pace: how many sets are tracked depends on the load of the machine.


def test_figures_of_a_recording(walk: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("rclpy", reason="ROS 2 is not installed")
    words = ["benchmark", "live", str(walk), "--rates", "2", "--json"]
    assert main(words) == 0, capsys.readouterr().err
    table = json.loads(capsys.readouterr().out)
    assert {"machine", "versions", "runs"} <= table.keys()
    (row,) = table["runs"]
    assert (row["source"], row["rate"], row["start"]) == (str(walk), 2.0, "given")
    assert row["sets"] == 6 and 1 <= row["tracked"] <= 6
    assert row["tracked"] + row["skipped"] + row["lost"] <= 6
    # The pace of the recording itself: six sets, half a second apart.
    assert row["played_s"] >= 2.5
    assert row["per_second"] == pytest.approx(row["tracked"] / row["played_s"])
    assert 0.0 < row["latency_ms"]["median"] <= row["latency_ms"]["p95"]
    assert row["cpu_ms"]["tracker"] > 0.0 and row["cpu_ms"]["player"] > 0.0
    assert row["first_pose_s"] > 0.0
    assert 0.0 < row["mean_mm"] < 40.0
    assert row["reference_us"] > 0.0 and row["cores_at_once"] > 0.0


def test_without_ros_it_is_one_line(
    walk: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "rclpy", None)
    assert main(["benchmark", "live", str(walk)]) == 1
    err = capsys.readouterr().err
    assert "ROS 2 is not installed" in err and err.count("\n") == 1


@pytest.mark.parametrize("rates", ["0", "60,fast", "-1"])
def test_impossible_rates_are_wrong_usage(
    walk: Path, rates: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["benchmark", "live", str(walk), f"--rates={rates}"])
    assert ended.value.code == 2 and "--rates" in capsys.readouterr().err
