"""The One Euro filter: calm when standing, in time when moving."""

import numpy as np
import pytest

from markerless_tracker.body import load_body, markers
from markerless_tracker.tracking.smoothing import OneEuro

FRAME_NS = 16_666_667


@pytest.fixture(scope="module")
def body():
    return load_body("person31", 1.75)


def run(body, poses):
    smooth = OneEuro(body)
    return np.array([smooth(pose, i * FRAME_NS) for i, pose in enumerate(poses)])


def test_standing_still_is_calm(body) -> None:
    rng = np.random.default_rng(0)
    noise = np.where(np.isfinite(body.spread), 0.01, 0.004)
    poses = body.neutral + noise * rng.standard_normal((180, body.size))
    points = np.array([markers(body, pose) for pose in run(body, poses)])[30:]
    raw = np.array([markers(body, pose) for pose in poses])[30:]
    jitter_mm = 1e3 * np.sqrt(((points - points.mean(axis=0)) ** 2).sum(axis=2).mean(axis=0))
    raw_mm = 1e3 * np.sqrt(((raw - raw.mean(axis=0)) ** 2).sum(axis=2).mean(axis=0))
    assert raw_mm.mean() > 8.0
    assert jitter_mm.max() < 0.5 * raw_mm.max()


@pytest.mark.parametrize(("name", "amplitude", "hz"), [("l_knee", 0.5, 1.0), ("r_hip_y", 0.4, 1.0)])
def test_a_walk_lags_by_a_frame_at_most(body, name, amplitude, hz) -> None:
    k = body.index(name)
    times = np.arange(240) * FRAME_NS * 1e-9
    poses = np.tile(body.neutral, (times.size, 1))
    poses[:, k] += amplitude * np.sin(2.0 * np.pi * hz * times)
    out = run(body, poses)[60:, k]
    gaps = [np.abs(out - np.roll(poses[:, k], lag)[60:]).mean() for lag in range(4)]
    assert np.argmin(gaps) <= 1


def test_walking_off_lags_by_a_frame_at_most(body) -> None:
    k = body.index("pelvis_tx")
    poses = np.tile(body.neutral, (120, 1))
    speed_m_s = 0.5
    poses[:, k] = speed_m_s * np.arange(120) / 60.0
    lag_s = (poses[60:, k] - run(body, poses)[60:, k]) / speed_m_s
    assert lag_s.max() < 1.05 / 60.0


def test_a_gap_begins_anew(body) -> None:
    smooth = OneEuro(body)
    smooth(body.neutral, 0)
    later = body.neutral + 0.5
    np.testing.assert_array_equal(smooth(later, 10**9), later)
