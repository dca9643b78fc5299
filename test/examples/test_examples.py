"""The examples that need no ROS, run as programs; `test/node` runs the other one."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from markerless_tracker import read_trc, score


@pytest.fixture
def run_example(project_root: Path, tmp_path: Path):
    """Runs an example in an empty folder; returns the lines that it prints."""

    def run(name: str, *arguments: str) -> list[str]:
        done = subprocess.run(
            [sys.executable, str(project_root / "examples" / f"{name}.py"), *arguments],
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


@pytest.mark.parametrize("name", ["own_optimizer", "own_cost", "own_segmenter"])
def test_parts_of_ones_own(run_example, name: str) -> None:
    lines = run_example(name, "--frames", "3")
    assert len(lines) == 3 and lines[0].startswith("0: ")
    assert "TRACKING" in lines[2], "the person is found and tracked"
    assert float(lines[2].rpartition(" ")[2]) > 0.85


def test_every_example_is_tested(project_root: Path) -> None:
    names = {path.stem for path in (project_root / "examples").glob("*.py")}
    assert names == {
        "listen", "track_arrays", "track_recording", "own_optimizer", "own_cost", "own_segmenter",
    }  # fmt: skip
