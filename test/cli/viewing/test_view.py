"""Verb `view`."""

import json
from collections.abc import Iterable
from pathlib import Path

import cv2
import pytest

from markerless_tracker.body import load_body, markers
from markerless_tracker.cli.main import main
from markerless_tracker.records import TrackResult, TrackState
from markerless_tracker.results.result import ResultWriter
from markerless_tracker.tracking import TrackerConfig


@pytest.fixture
def result(walk: Path, tmp_path: Path) -> str:
    """NAME of a result on the recording `walk`."""
    return write_result(tmp_path / "out", walk, range(6))


def write_result(name: Path, walk: Path, sets: Iterable[int]) -> str:
    """Write a result on those sets of the recording `walk`: a person who stands."""
    body = load_body("balan31", 1.7)
    pose = body.neutral.copy()
    pose[body.index("pelvis_tz")] = 0.9
    config = TrackerConfig.from_mapping({"body": "balan31"})
    with ResultWriter(name, body, config, fps=30.0, source=str(walk)) as writer:
        for index in sets:
            writer.add(
                TrackResult(
                    stamp_ns=round(index * 1e9 / 30.0),
                    state=TrackState.TRACKING,
                    pose=pose,
                    markers_m=markers(body, pose),
                    fitness=1.0,
                    iou={},
                    evaluations=0,
                )
            )
    return str(name)


def test_film_and_picture(result: str, tmp_path: Path, capsys) -> None:
    av = pytest.importorskip("av", reason="PyAV is not installed: pip install av")
    film, sheet = tmp_path / "new" / "a.mp4", tmp_path / "new" / "a.png"
    words = ["view", result, "--film", str(film), "--sheet", str(sheet), "--frames", "2"]
    assert main([*words, "--width", "320", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["files"] == [str(film), str(sheet)]
    with av.open(str(film)) as opened:
        assert sum(1 for _ in opened.decode(video=0)) == 6
        assert opened.streams.video[0].width <= 320
    picture = cv2.imread(str(sheet))
    # Two lines of four cameras.
    assert picture.shape[1] <= 320 and 0.3 < picture.shape[0] / picture.shape[1] < 1.1
    assert main(words) == 1
    assert "exists already, expected a new name or --force" in capsys.readouterr().err


def test_a_film_is_in_the_time_of_the_result(walk: Path, tmp_path: Path) -> None:
    av = pytest.importorskip("av", reason="PyAV is not installed: pip install av")
    sets, film = (0, 1, 3, 5), tmp_path / "a.webm"
    result = write_result(tmp_path / "live", walk, sets)
    assert main(["view", result, "--film", str(film), "--width", "320"]) == 0
    with av.open(str(film)) as opened:
        times_s = [frame.time for frame in opened.decode(video=0)]
    assert times_s == pytest.approx([number / 30 for number in sets], abs=1e-3)


def test_a_file_for_the_rerun_viewer(result: str, walk: Path, tmp_path: Path, capsys) -> None:
    pytest.importorskip("rerun", reason="rerun-sdk is not installed: pip install rerun-sdk")
    path = tmp_path / "a.rrd"
    assert main(["view", result, "--rrd", str(path), "--source", str(walk)]) == 0
    assert capsys.readouterr().out == f"{path}\n" and path.read_bytes()[:2] == b"RR"


def test_what_cannot_be_shown_fails_in_one_line(
    result: str, tmp_path: Path, capsys, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.setattr("markerless_tracker.cli.view.require_rerun", lambda: None)
    for words, said in (
        ([result], "no display for the Rerun viewer, expected --film"),
        ([result, "--sheet", "a.png", "--source", str(tmp_path / "no")], "are not there"),
        ([str(tmp_path / "none"), "--sheet", "a.png"], "none.json"),
    ):
        capsys.readouterr()
        assert main(["view", *words]) == 1
        err = capsys.readouterr().err
        assert err.count("\n") == 1 and said in err
    for words, said in (
        (["--film", "a.avi"], "ends in .webm or .mp4"),
        (["--sheet", "a.gif"], "ends in .png or .jpg"),
        (["--rrd", "a"], "ends in .rrd"),
        (["--frames", "0"], "whole number from 1"),
        (["--width", "1"], "expected at least 64 px"),
    ):
        with pytest.raises(SystemExit):
            main(["view", result, *words])
        assert said in capsys.readouterr().err
