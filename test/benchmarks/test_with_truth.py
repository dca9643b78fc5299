"""Runs on recordings with reference markers, from the frame of the start on."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from markerless_tracker.benchmarks.with_truth import RunStart, open_with_truth, tracked_markers
from markerless_tracker.cli.synthesize import synthesize
from markerless_tracker.datasets import read_trc, write_trc
from markerless_tracker.errors import DatasetError
from markerless_tracker.synthesis import SyntheticScene
from markerless_tracker.tracking import TrackerConfig

CONFIG = TrackerConfig.from_mapping({"threads": 1, "refinement": "none", "evaluations": 200})


@pytest.fixture
def walk(tmp_path: Path) -> Path:
    """A made-up walk of a few small frames."""
    scene = SyntheticScene(body="person31", cameras=2, size_px=(64, 48), samples=1)
    synthesize(tmp_path / "walk", scene, frames=3, lossless=True)
    return tmp_path / "walk"


@pytest.mark.parametrize("shift_ns", [-500_000_000, 500_000_000])
def test_a_measured_start_at_a_time_without_a_frame_is_refused(walk: Path, shift_ns: int) -> None:
    truth = read_trc(walk / "ground_truth.trc")
    write_trc(walk / "ground_truth.trc", replace(truth, stamps_ns=truth.stamps_ns + shift_ns), 60.0)
    with (
        open_with_truth(walk, CONFIG) as recording,
        pytest.raises(DatasetError, match="walk: no frame within half a frame of -?0.500000 s"),
    ):
        recording.run(CONFIG, RunStart())


def test_a_run_begins_with_the_frame_of_the_start(walk: Path) -> None:
    truth = read_trc(walk / "ground_truth.trc")
    write_trc(walk / "ground_truth.trc", truth.rows(slice(1, None)), 60.0)
    with open_with_truth(walk, CONFIG) as recording:
        results, true = recording.run(CONFIG, RunStart())
    assert [result.stamp_ns for result in results] == truth.stamps_ns[1:].tolist()
    np.testing.assert_allclose(true, truth.positions_m[1:], atol=1e-5)


def test_no_results_have_no_markers() -> None:
    assert tracked_markers([]).shape == (0, 15, 3)
