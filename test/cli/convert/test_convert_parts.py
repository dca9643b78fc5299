"""`convert` of a part of a recording, and `convert` that is killed."""

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from markerless_tracker.cli.main import main
from markerless_tracker.datasets import open_recording


def converted(source: Path, out: Path, *words: object) -> list[int]:
    """Indices in the source of the sets of the bag that `convert` writes."""
    assert main(["convert", str(source), str(out), *map(str, words)]) == 0
    bag = open_recording(out)
    return [round(frame.stamp_ns * 60 / 1e9) for frame in bag.frames()]


def test_cameras_and_a_range_of_time(make_recording, tmp_path: Path, capsys) -> None:
    source = make_recording(frames=12, fps=60.0)
    words = ["--cameras", "cam02", "--start", "0.05", "--end", "0.15", "--json"]
    assert converted(source, tmp_path / "a", *words) == [3, 4, 5, 6, 7, 8, 9]
    summary = json.loads(capsys.readouterr().out)
    assert (summary["cameras"], summary["frames"]) == (["cam02"], 7)
    assert list(open_recording(tmp_path / "a").background_frames()) == ["cam02"]
    assert converted(source, tmp_path / "b", "--start", "0.05", "--fps", "20") == [3, 6, 9]
    # Of a bag, whose times count from its first set.
    assert converted(tmp_path / "a", tmp_path / "c", "--start", "0.05", "--end", 0.1) == [
        6,
        7,
        8,
        9,
    ]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--cameras", "cam02,cam9"], "small: no camera cam9, expected some of cam01, cam02"),
        (["--cameras", ","], "no camera chosen"),
        (["--start", "9"], "small: ends 0.083 s after its first set, expected to start at 9 s"),
        (["--start", "-1"], "time from -1 s to the end"),
        (["--start", "0.05", "--end", "0.01"], "time from 0.05 s to 0.01 s"),
    ],
)
def test_an_impossible_part(make_recording, tmp_path: Path, capsys, words, message) -> None:
    assert main(["convert", str(make_recording()), str(tmp_path / "bag"), *words]) == 1
    assert message in capsys.readouterr().err and not (tmp_path / "bag").exists()


def test_a_cut_bag_is_converted_up_to_the_cut(make_recording, tmp_path: Path, capsys) -> None:
    converted(make_recording(frames=120), tmp_path / "whole")
    file = tmp_path / "whole" / "whole.mcap"
    content = file.read_bytes()
    file.write_bytes(content[: len(content) // 2])
    capsys.readouterr()
    kept = converted(tmp_path / "whole", tmp_path / "again")
    assert kept == list(range(len(kept))) and 20 < len(kept) < 100
    assert capsys.readouterr().err.count("cut or damaged, read up to there") == 1
    assert open_recording(tmp_path / "again").warnings == ()


@pytest.mark.parametrize("delay_s", [0.0, 0.03, 0.2])
def test_a_kill_leaves_the_earlier_bag_or_the_new_one(
    make_recording, tmp_path: Path, delay_s: float
) -> None:
    bag = tmp_path / "bag"
    converted(make_recording("short", frames=3), bag)
    longer = make_recording("long", frames=300)
    words = ["convert", str(longer), str(bag), "--force"]
    process = subprocess.Popen(
        [sys.executable, "-m", "markerless_tracker", *words],
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    while process.poll() is None and not any(tmp_path.glob(".bag.partial-*")):
        time.sleep(0.002)
    time.sleep(delay_s)
    process.send_signal(signal.SIGKILL)
    process.wait()
    recording = open_recording(bag)
    assert len(list(recording.frames())) in (3, 300) and recording.warnings == ()
    # The next conversion removes what is left of the killed one.
    assert len(converted(make_recording("next", frames=4), bag, "--force")) == 4
    assert not list(tmp_path.glob(".*"))
