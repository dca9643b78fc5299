"""Jitter and lag of computed tracks, and of a made-up standing person."""

from pathlib import Path

import numpy as np
import pytest

from markerless_tracker.benchmarks.jitter import (
    compared,
    jitter_mm,
    lag_frames,
    longest_true_run,
    measure_jitter,
)
from markerless_tracker.benchmarks.with_truth import RunStart
from markerless_tracker.cli.synthesize import synthesize
from markerless_tracker.errors import DatasetError
from markerless_tracker.synthesis import SyntheticScene
from markerless_tracker.tracking import TrackerConfig

TIMES = np.arange(180) / 60.0


def track(*coordinates) -> np.ndarray:
    """One joint (n, 1, 3) from its coordinates over time."""
    return np.stack([np.broadcast_to(c, TIMES.shape) for c in coordinates], axis=1)[:, None, :]


def test_jitter_is_the_rms_of_the_fast_motion() -> None:
    flicker = 0.003 * (-1.0) ** np.arange(180)
    assert jitter_mm(track(flicker, 0.0, 0.0), 60)[0] == pytest.approx(3.0, rel=0.03)
    both = jitter_mm(track(flicker, flicker, 0.0), 60)[0]
    assert both == pytest.approx(3.0 * np.sqrt(2.0), rel=0.03)


def test_offsets_and_steady_motion_are_no_jitter() -> None:
    moved = track(0.2 + 0.5 * TIMES, -1.0, 0.3 * TIMES)
    assert jitter_mm(moved, 60)[0] == pytest.approx(0.0, abs=1e-6)
    sway = track(0.02 * np.sin(2.0 * np.pi * 0.2 * TIMES), 0.0, 0.0)
    assert jitter_mm(sway, 60)[0] < 2.0


def test_jitter_is_per_joint() -> None:
    rng = np.random.default_rng(0)
    points = rng.normal(size=(2000, 2, 3)) * np.array([0.001, 0.004])[:, None]
    expected = np.array([1.0, 4.0]) * np.sqrt(3.0)
    np.testing.assert_allclose(jitter_mm(points, 61), expected, rtol=0.06)


@pytest.mark.parametrize("shift", [-3.0, 0.0, 0.4, 1.0, 2.5])
def test_the_lag_of_a_shifted_sine(shift) -> None:
    def sine(late: float) -> np.ndarray:
        t = TIMES - late / 60.0
        return track(0.3 * np.sin(2.0 * np.pi * t), 1.2 * t, 0.1 * np.cos(4.0 * np.pi * t))

    noise = 0.002 * np.random.default_rng(1).standard_normal((180, 1, 3))
    late = sine(shift) + noise + np.array([0.05, 0.0, -0.03])
    assert lag_frames(late, sine(0.0)) == pytest.approx(shift, abs=0.02)


def test_the_lag_of_noise_behind_itself_is_none() -> None:
    for seed in range(5):
        noise = np.random.default_rng(seed).standard_normal((40, 1, 3))
        assert lag_frames(noise, noise) == pytest.approx(0.0, abs=0.01)


def test_the_longest_run() -> None:
    flags = np.array([1, 1, 0, 1, 1, 1, 0, 1], bool)
    assert longest_true_run(flags) == slice(3, 6)
    assert longest_true_run(np.zeros(4, bool)) == slice(0, 0)
    assert longest_true_run(np.ones(4, bool)) == slice(0, 4)


class TestTheFramesCompared:
    points = np.zeros((60, 15, 3))

    def test_are_those_with_a_pose_and_a_truth(self) -> None:
        points, truth = self.points.copy(), self.points.copy()
        points[:3] = np.nan
        truth[10] = np.nan
        truth[50:] = np.nan
        truth[:, 4] = np.nan
        kept, names = compared(points, truth, Path("walk"))
        assert kept == slice(11, 50) and names.tolist() == [0, 1, 2, 3, *range(5, 15)]

    def test_are_too_few(self) -> None:
        truth = self.points.copy()
        truth[30] = np.nan
        with pytest.raises(DatasetError, match="walk: tracked for 30 frames in a row with a truth"):
            compared(self.points, truth, Path("walk"))

    def test_have_no_marker(self) -> None:
        nothing = np.full_like(self.points, np.nan)
        with pytest.raises(
            DatasetError, match="60 frames has none of the markers, expected .*Neck"
        ):
            compared(self.points, nothing, Path("walk"))

    def test_have_no_marker_in_common(self) -> None:
        truth = self.points.copy()
        truth[:30, :8] = truth[30:, 8:] = np.nan
        with pytest.raises(DatasetError, match="no marker has a truth in all of the 60 frames"):
            compared(self.points, truth, Path("walk"))


@pytest.fixture(scope="module")
def stand(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A made-up standing person, noisy small images, 60 frames/s."""
    scene = SyntheticScene(
        body="person31", motion="stand", size_px=(200, 152), samples=1, noise=8.0, seed=1
    )
    folder = tmp_path_factory.mktemp("made") / "stand"
    synthesize(folder, scene, frames=40, lossless=True)
    return folder


def test_the_filter_reduces_the_jitter_of_a_standing_person(stand) -> None:
    config = TrackerConfig.from_mapping({"threads": 1})
    row = measure_jitter(stand, config, start=RunStart())
    plain, filtered = row["none"], row["one_euro"]
    assert row["frames"] == 40 and row["fps"] == 60.0 and row["start"] == "measured"
    assert plain["lag_frames"] == pytest.approx(0.0, abs=0.01)
    assert filtered["jitter_mm"] < 0.95 * plain["jitter_mm"]
    assert filtered["mean_mm"] < plain["mean_mm"] + 2.0


def test_a_recording_without_truth_is_refused(stand, tmp_path: Path) -> None:
    for file in stand.iterdir():
        if file.name != "ground_truth.trc":
            (tmp_path / file.name).symlink_to(file)
    with pytest.raises(DatasetError, match=r"no ground_truth\.trc, expected one as the reference"):
        measure_jitter(tmp_path, TrackerConfig(), start=RunStart())
