"""Whole runs with subsets of the cameras."""

from pathlib import Path

import numpy as np
import pytest

from markerless_tracker.benchmarks.cameras import measure_cameras, score_run
from markerless_tracker.benchmarks.with_truth import RunStart
from markerless_tracker.cli.synthesize import synthesize
from markerless_tracker.errors import ConfigError, DatasetError
from markerless_tracker.synthesis import SyntheticScene
from markerless_tracker.tracking import TrackerConfig

CONFIG = TrackerConfig.from_mapping({"threads": 1})


@pytest.fixture(scope="module")
def walk(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A made-up walk of a few small frames in three views."""
    scene = SyntheticScene(body="person31", cameras=3, size_px=(200, 152), samples=1)
    folder = tmp_path_factory.mktemp("made") / "walk"
    synthesize(folder, scene, frames=4, lossless=True)
    return folder


def test_every_subset_is_run_after_all_cameras(walk) -> None:
    row = measure_cameras(walk, CONFIG, starts=[RunStart()], counts=(2,))
    names = [run["cameras"] for run in row["runs"]]
    assert names == [
        ["cam01", "cam02", "cam03"],
        ["cam01", "cam02"], ["cam01", "cam03"], ["cam02", "cam03"],
    ]  # fmt: skip
    first, *others = row["runs"]
    assert first["ratio"] == 1.0 and first["found"] == 1.0 and first["start"] == "measured"
    for run in others:
        assert run["ratio"] == pytest.approx(run["mean_mm"] / first["mean_mm"])


@pytest.mark.parametrize("counts", [(3,), (2, 4), (0,)])
def test_a_subset_must_be_smaller_than_the_rig(walk, counts) -> None:
    with pytest.raises(ConfigError, match="of 3 cameras, expected fewer than 3"):
        measure_cameras(walk, CONFIG, starts=[RunStart()], counts=counts)


def test_score_of_known_offsets() -> None:
    truth = np.zeros((4, 15, 3))
    truth[3] = np.nan
    points = truth.copy()
    points[0, :, 0] = 0.010
    points[1, :, 0] = 0.030
    points[1, 4, 0] = 0.180
    points[2] = np.nan
    figures = score_run(points, truth)
    assert figures["max_mm"] == pytest.approx(40.0)
    assert figures["mean_mm"] == pytest.approx(25.0)
    assert figures["worst_joint_mm"] == pytest.approx(180.0)
    assert figures["lost_run"] == 2 and figures["found"] == pytest.approx(2.0 / 3.0)


def test_frames_without_a_pose_are_lost_and_do_not_divide_a_run() -> None:
    truth = np.zeros((10, 15, 3))
    points = truth + 0.2
    points[0] = 0.0
    points[3] = np.nan
    truth[6] = np.nan
    assert score_run(points, truth)["lost_run"] == 8


def test_an_automatic_start_of_too_few_frames_is_refused(walk) -> None:
    with pytest.raises(DatasetError, match="4 frames, expected some with a truth after the first"):
        measure_cameras(walk, CONFIG, starts=[RunStart(), RunStart(False)], counts=(2,))


def test_score_without_any_pose() -> None:
    truth = np.zeros((4, 15, 3))
    figures = score_run(np.full_like(truth, np.nan), truth)
    assert figures["mean_mm"] is None and figures["found"] == 0.0 and figures["lost_run"] == 4
    nothing = np.zeros((0, 15, 3))
    assert score_run(nothing, nothing)["lost_run"] == 0
