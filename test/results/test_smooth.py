"""Smoothing without lag, velocities and filled gaps."""

import json
from pathlib import Path

import numpy as np
import pytest

from markerless_tracker.body import load_body, markers
from markerless_tracker.datasets import read_trc
from markerless_tracker.errors import ConfigError
from markerless_tracker.records import Confidence, TrackResult, TrackState
from markerless_tracker.results.read import read_result
from markerless_tracker.results.result import ResultWriter
from markerless_tracker.results.smooth import Smoothing, rts, smooth_result
from markerless_tracker.results.stored import stored_frames
from markerless_tracker.tracking import TrackerConfig

BODY = load_body("person31", 1.75)
FPS = 60.0
COUNT = 90
TIMES = np.arange(COUNT) / FPS
ELBOW, HEADING = BODY.index("l_elbow"), BODY.index("pelvis_rz")


def true_poses() -> np.ndarray:
    """(n, p) an elbow that swings at 1 Hz, and a person that turns beyond half a turn."""
    poses = np.tile(BODY.neutral, (COUNT, 1))
    poses[:, ELBOW] = -1.0 + 0.6 * np.sin(2.0 * np.pi * TIMES)
    poses[:, HEADING] = 3.0 + 0.5 * TIMES
    return poses


def write(name: Path, poses: np.ndarray, lost: range | tuple[int, ...] = ()) -> Path:
    config = TrackerConfig.from_mapping({"body": "person31"})
    with ResultWriter(name, BODY, config, fps=FPS) as writer:
        for index, pose in enumerate(poses):
            shown = (pose + np.pi) % (2.0 * np.pi) - np.pi
            shown[BODY.translations] = pose[BODY.translations]
            writer.add(
                TrackResult(
                    stamp_ns=round(index * 1e9 / FPS),
                    state=TrackState.LOST if index in lost else TrackState.TRACKING,
                    pose=shown,
                    markers_m=markers(BODY, shown),
                    fitness=1.5,
                    iou={},
                    evaluations=1,
                    confidence=Confidence(
                        np.full(BODY.size, 0.02), np.full((15, 3), 0.01), np.eye(6)
                    ),
                )
            )
    return name


@pytest.fixture
def noisy() -> np.ndarray:
    rng = np.random.default_rng(0)
    poses = true_poses()
    noise = rng.normal(0.0, 0.02, poses.shape)
    noise[:, BODY.translations] *= 0.2
    return poses + noise


def response(frequency_hz: float, cutoff_hz: float) -> complex:
    """Gain and phase of the smoother for a sine, in the middle of a long series."""
    times = np.arange(2400) / 240.0
    wave = np.sin(2.0 * np.pi * frequency_hz * times)
    out, variance = np.empty((2, times.size))
    density = 1e-4 / 240.0 * (2.0 * np.pi * cutoff_hz) ** 4
    variances = np.full(times.size, 1e-4)
    rts(times, wave, variances, density, np.empty((times.size, 10)), out, variance)
    held = slice(720, 1680)
    carrier = np.exp(-2j * np.pi * frequency_hz * times[held])
    return complex(2j * (out[held] * carrier).mean())


@pytest.mark.parametrize("ratio", [0.25, 1.0, 2.0])
def test_the_gain_is_that_of_a_butterworth_filter_passed_twice_without_phase(ratio) -> None:
    found = response(6.0 * ratio, 6.0)
    assert found.real == pytest.approx(1.0 / (1.0 + ratio**4), abs=0.02)
    assert abs(found.imag) < 0.005


def test_noise_goes_and_motion_stays(tmp_path: Path, noisy) -> None:
    name = write(tmp_path / "out", noisy)
    before = read_result(name)
    assert smooth_result(name, Smoothing(6.0)) == 0
    after = read_result(name)
    truth = np.array([markers(BODY, pose) for pose in true_poses()])
    errors = [np.linalg.norm(found.positions_m - truth, axis=2).mean() for found in (before, after)]
    assert errors[1] < 0.7 * errors[0]
    jerk = [np.abs(np.diff(found.positions_m, 3, axis=0)).mean() for found in (before, after)]
    assert jerk[1] < 0.1 * jerk[0]
    elbow = after.parameter("l_elbow")
    assert np.abs(elbow - true_poses()[:, ELBOW]).max() < 0.06
    track = read_trc(name.with_suffix(".trc"))
    poses = np.array([markers(BODY, pose) for pose in after.parameters])
    np.testing.assert_allclose(track.positions_m, poses, atol=1e-6)
    assert after.summary["smoothing"] == {"cutoff_hz": 6.0, "fill_gaps_s": 0.0, "filled": 0}
    line = name.with_suffix(".trc").read_text(encoding="utf-8").splitlines()[0]
    assert line.endswith("\tout.trc")
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "out.json", "out.subject.yaml", "out.trc",
    ]  # fmt: skip


def test_velocities_are_those_of_the_smoothed_markers(tmp_path: Path, noisy) -> None:
    name = write(tmp_path / "out", noisy)
    raw = read_result(name).velocities_m_s()[:, 5]
    smooth_result(name, Smoothing(6.0))
    content = json.loads(name.with_suffix(".json").read_text(encoding="utf-8"))
    found = np.array([frame["velocities_m_s"]["LWrist"] for frame in content["frames"]])
    truth = np.gradient(
        np.array([markers(BODY, pose)[5] for pose in true_poses()]), 1.0 / FPS, axis=0
    )
    errors = [np.sqrt(((values - truth)[10:-10] ** 2).mean()) for values in (raw, found)]
    assert errors[1] < 0.25 * errors[0]
    np.testing.assert_allclose(found, read_result(name).velocities_m_s()[:, 5], atol=1e-3)


def test_gaps_are_filled_on_request_only_and_marked(tmp_path: Path) -> None:
    lost = range(40, 52)
    for fill_s, filled in ((0.0, 0), (0.1, 0), (0.3, 12)):
        name = write(tmp_path / f"out{fill_s}", true_poses(), lost)
        before = read_result(name)
        assert smooth_result(name, Smoothing(None, fill_s)) == filled
        after = read_result(name)
        held = np.ones(COUNT, dtype=bool)
        held[lost] = False
        np.testing.assert_array_equal(after.parameters[held], before.parameters[held])
        np.testing.assert_array_equal(after.filled, ~held if filled else np.zeros(COUNT, bool))
        np.testing.assert_array_equal(after.states, before.states)
        assert np.isnan(after.positions_m[lost]).all() == (filled == 0)
    elbow = after.parameter("l_elbow")[lost]
    assert np.abs(elbow - true_poses()[lost, ELBOW]).max() < 0.1
    sd = after.sd("LWrist")[lost].sum(axis=1)
    assert sd[5] > 1.5 * sd[0], "deviations grow towards the middle of a gap"
    path = name.with_name(f"{name.name}.trc")
    stored = stored_frames(path, read_trc(path))
    assert stored is not None
    assert not stored.track.tracked[lost].any(), "evaluate compares no filled frame"


@pytest.mark.parametrize("first", (20, 33))
def test_a_gap_of_exactly_the_longest_duration_is_filled(tmp_path: Path, first: int) -> None:
    """Between the tracked frames beside 29 lost ones lies half a second, but for rounding."""
    name = write(tmp_path / "out", true_poses(), range(first, first + 29))
    assert smooth_result(name, Smoothing(None, 0.5)) == 29
    assert smooth_result(name, Smoothing(None, 0.49)) == 0


def test_nothing_is_smoothed_across_a_long_gap(tmp_path: Path, noisy) -> None:
    noisy[45:, ELBOW] += 1.0
    name = write(tmp_path / "out", noisy, range(20, 45))
    smooth_result(name, Smoothing(6.0))
    elbow = read_result(name).parameter("l_elbow")
    assert np.isnan(elbow[20:45]).all()
    truth = true_poses()[:, ELBOW]
    assert np.abs(elbow[:20] - truth[:20]).max() < 0.06
    assert np.abs(elbow[45:] - truth[45:] - 1.0).max() < 0.06


def test_impossible_values() -> None:
    for wrong in ((0.0, 0.0), (-6.0, 0.0), (6.0, -1.0), (6.0, 100.0), (float("nan"), 0.0)):
        with pytest.raises(ConfigError, match="expected from"):
            Smoothing(*wrong)


def test_a_cutoff_above_the_motion_that_frames_show() -> None:
    for rate, cutoff in ((60.0, 30.0), (12.0, 6.0), (1.0, None)):
        Smoothing(cutoff).check_rate(rate)
    with pytest.raises(
        ConfigError, match=r"smooth is 100 Hz, expected from 0.1 to 30, .* \(60 frames/s\)"
    ):
        Smoothing(100.0).check_rate(60.0)
