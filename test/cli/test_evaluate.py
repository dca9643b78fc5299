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
