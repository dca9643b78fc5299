"""The examples that need no ROS, run as programs; `test/node` runs the other one."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from markerless_tracker import read_trc, score


@pytest.fixture
def run_example(run_program, project_root: Path):
    """Runs an example in an empty folder; returns the lines that it prints."""

    def run(name: str, *arguments: str) -> list[str]:
        return run_program(str(project_root / "examples" / f"{name}.py"), *arguments)

    return run


@pytest.fixture
def run_program(project_root: Path, tmp_path: Path):
    """Runs Python with arguments in an empty folder; returns the lines that it prints."""

    def run(*arguments: str) -> list[str]:
        done = subprocess.run(
            [sys.executable, *arguments],
            capture_output=True,
            text=True,
            cwd=tmp_path,
            env={**os.environ, "PYTHONPATH": str(project_root)},
        )
        assert done.returncode == 0, done.stderr
        return done.stdout.splitlines()

    return run


def test_a_recording_from_disk(run_example, walk: Path, tmp_path: Path) -> None:
    lines = run_example("track_recording", str(walk), "out/walk")
    assert len(lines) == 7 and all("TRACKING, head" in line for line in lines[:6])
    assert lines[6] == "out/walk.trc"
    reference = read_trc(walk / "ground_truth.trc")
    found = score(read_trc(tmp_path / "out" / "walk.trc"), reference)
    assert found.frames == 6 and found.mean_mm < 30.0
    held = np.linalg.norm(reference.positions_m - reference.positions_m[0], axis=2).mean() * 1000.0
    assert held > 60.0, "the start pose itself would pass"


def test_images_in_memory(run_example) -> None:
    lines = run_example("track_arrays", "--frames", "4")
    assert len(lines) == 4
    assert lines[0].startswith("0.000 s: ") and lines[3].startswith("0.050 s: ")
    assert "right wrist" in lines[3]


OWN = {
    "own_optimizer": "RandomSearch._ask",
    "own_cost": "NearPrediction.run",
    "own_segmenter": "segment",
}
"""Example -> its function of one's own."""
COUNTED = """
import runpy, sys

calls = 0

def profile(frame, event, _):
    global calls
    code = frame.f_code
    calls += event == "call" and code.co_qualname == {own!r} and code.co_filename == {path!r}

sys.argv = [{path!r}, "--frames", "12"]
sys.setprofile(profile)
runpy.run_path({path!r}, run_name="__main__")
sys.setprofile(None)
print(calls)
"""
"""Runs an example and prints how often its own function was called."""


@pytest.mark.parametrize("name", OWN)
def test_parts_of_ones_own(run_program, project_root: Path, name: str) -> None:
    path = str(project_root / "examples" / f"{name}.py")
    *lines, calls = run_program("-c", COUNTED.format(path=path, own=OWN[name]))
    assert int(calls) >= 4, "what is registered is used"
    assert len(lines) == 12 and lines[0].startswith("0: ")
    assert "TRACKING" in lines[11], "the person is found and tracked"
    assert float(lines[11].rpartition(" ")[2]) > 0.85


def test_every_example_is_tested(project_root: Path) -> None:
    names = {path.stem for path in (project_root / "examples").glob("*.py")}
    assert names == {
        "listen", "track_arrays", "track_recording", "own_optimizer", "own_cost", "own_segmenter",
    }  # fmt: skip
