"""The verb `evaluate`, as a user calls it."""

import json
from pathlib import Path

import numpy as np
import pytest

from markerless_tracker.cli.main import main
from markerless_tracker.datasets import MarkerTrack, write_trc

NAMES = ("LHip", "RHip", "Neck", "Head")
POSE = np.array([[0.0, 0.1, 1.0], [0.0, -0.1, 1.0], [0.0, 0.0, 1.5], [0.0, 0.0, 1.7]])


@pytest.fixture
def files(tmp_path: Path) -> tuple[str, str]:
    """A result 20 mm ahead whose second row is blank, and its reference."""
    stamps = np.array([0, 50_000_000, 100_000_000])
    truth = np.repeat(POSE[None], 3, 0)
    found = truth + [0.02, 0.0, 0.0]
    found[1] = np.nan
    write_trc(tmp_path / "truth.trc", MarkerTrack(NAMES, stamps, truth), 20.0)
    write_trc(tmp_path / "result.trc", MarkerTrack(NAMES, stamps, found), 20.0)
    return str(tmp_path / "result.trc"), str(tmp_path / "truth.trc")


def test_json(files, capsys) -> None:
    assert main(["evaluate", *files, "--json"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary["mean_mm"] == pytest.approx(20.0)
    assert (summary["frames"], summary["reference_frames"]) == (2, 3)
    assert summary["bias"]["Pelvis"] == pytest.approx([20.0, 0.0, 0.0], abs=1e-6)
    assert list(summary["joints"]) == [*NAMES, "Pelvis"]
    assert len(summary["frame_mm"]) == 2


def test_a_table(files, capsys) -> None:
    assert main(["evaluate", *files]) == 0
    out = capsys.readouterr().out
    assert "Head" in out and "+20.0" in out
    assert "mean 20.0 mm" in out and "2 of 3 reference frames" in out
    assert [line for line in out.splitlines() if line[80:]] == []


def test_a_result_may_be_given_by_its_name(files, capsys) -> None:
    assert main(["evaluate", *files]) == 0
    expected = capsys.readouterr().out
    assert main(["evaluate", files[0].removesuffix(".trc"), files[1]]) == 0
    assert capsys.readouterr().out == expected and "is the reference" not in expected


def test_the_reference_of_another_recording_raises_a_question(
    files, tmp_path: Path, capsys
) -> None:
    stamps = np.array([0, 50_000_000, 100_000_000])
    other = np.repeat(POSE[None], 3, 0) + [2.0, 0.0, 0.0]
    write_trc(tmp_path / "other.trc", MarkerTrack(NAMES, stamps, other), 20.0)
    assert main(["evaluate", files[0], str(tmp_path / "other.trc")]) == 0
    assert "is the reference of this recording, and in the same world?" in capsys.readouterr().out


def test_what_cannot_be_compared_fails_in_one_line(files, tmp_path: Path, capsys) -> None:
    other = str(tmp_path / "other.trc")
    write_trc(other, MarkerTrack(("Nose",), np.array([0]), np.zeros((1, 1, 3))), 20.0)
    late = str(tmp_path / "late.trc")
    write_trc(late, MarkerTrack(NAMES, np.array([9 * 10**9]), POSE[None]), 20.0)
    (tmp_path / "broken.trc").write_text("PathFileType\nno header")
    for words, reported in (
        ([files[0], other], "no common marker"),
        ([late, files[1]], "no common frame"),
        ([files[0], str(tmp_path / "none.trc")], "none.trc: cannot be read"),
        ([str(tmp_path / "broken.trc"), files[1]], "broken.trc"),
    ):
        assert main(["evaluate", *words, "--json"]) == 1
        captured = capsys.readouterr()
        assert reported in captured.err and captured.err.count("\n") == 1 and not captured.out


def test_several_results_in_one_call(files, tmp_path: Path, capsys) -> None:
    found, truth = files
    assert main(["evaluate", found, truth, truth, "--json"]) == 0
    first, second = json.loads(capsys.readouterr().out)
    assert (first["result"], second["result"]) == (found, truth)
    assert (first["frames"], second["frames"], second["mean_mm"]) == (2, 3, 0.0)
    assert main(["evaluate", found, truth, truth]) == 0
    out = capsys.readouterr().out
    assert "2 of 3" in out and "3 of 3" in out and "20.0" in out
    assert main(["evaluate", found, str(tmp_path / "none.trc"), truth]) == 1
    captured = capsys.readouterr()
    assert "none.trc" in captured.err and not captured.out


def test_skipped_frames(files, capsys) -> None:
    assert main(["evaluate", *files, "--skip", "1", "--json"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert (summary["frames"], summary["reference_frames"]) == (1, 2)
    assert main(["evaluate", *files, "--skip", "3", "--json"]) == 1
    captured = capsys.readouterr()
    assert "result.trc: cannot skip 3 frames" in captured.err and not captured.out
    for wrong in ("-1", "1.5", "some"):
        with pytest.raises(SystemExit) as stopped:
            main(["evaluate", *files, "--skip", wrong])
        assert stopped.value.code == 2
        assert "expected a whole number from 0 on" in capsys.readouterr().err


def test_deviations_and_lost_frames_come_from_the_json_beside_the_result(
    files, tmp_path: Path, capsys
) -> None:
    deviations = dict.fromkeys(NAMES, [15.0, 1.0, 1.0])
    frames = [
        {"stamp_ns": 0, "state": "TRACKING", "markers_sd_mm": deviations},
        {"stamp_ns": 100_000_000, "state": "LOST", "markers_sd_mm": deviations},
    ]
    (tmp_path / "result.json").write_text(json.dumps({"frames": frames}))
    assert main(["evaluate", *files, "--json"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert (summary["frames"], summary["reference_frames"]) == (1, 3)
    assert summary["inside_sd"] == pytest.approx([2 / 3, 1.0, 1.0])
    assert summary["offsets_off_mm"] == pytest.approx({"limbs": 0.0, "all": 0.0}, abs=1e-6)
    assert main(["evaluate", *files]) == 0
    assert "inside 1, 2, 3 sd: 0.667, 1.000, 1.000" in capsys.readouterr().out


def test_another_tools_json_beside_a_marker_file_is_named(files, tmp_path: Path, capsys) -> None:
    (tmp_path / "result.json").write_text("[1, 2]")
    assert main(["evaluate", *files, "--json"]) == 0
    captured = capsys.readouterr()
    summary = json.loads(captured.out)
    assert (summary["frames"], summary["inside_sd"]) == (2, None)
    assert "result.json: no result of a tracker" in captured.err
