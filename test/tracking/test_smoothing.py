"""The One Euro filter: little jitter at rest, little lag in motion."""

import numpy as np
import pytest

from markerless_tracker.body import load_body, markers
from markerless_tracker.synthesis.motion import Motion
from markerless_tracker.tracking.smoothing import OneEuro

FRAME_NS = 16_666_667


@pytest.fixture(scope="module")
def body():
    return load_body("person31", 1.75)


def run(body, poses):
    smooth = OneEuro(body)
    return np.array([smooth(pose, i * FRAME_NS) for i, pose in enumerate(poses)])


def points_mm(body, poses):
    return 1e3 * np.array([markers(body, pose) for pose in poses])


def test_jitter_at_rest_is_small(body) -> None:
    rng = np.random.default_rng(0)
    noise = np.where(np.isfinite(body.prior_sd), 0.0032, 0.0012)
    poses = body.neutral + noise * rng.standard_normal((180, body.size))
    jitter_mm, raw_mm = (
        np.sqrt(((points - points.mean(axis=0)) ** 2).sum(axis=2).mean(axis=0))
        for points in (points_mm(body, run(body, poses))[30:], points_mm(body, poses)[30:])
    )
    assert raw_mm.max() > 4.0
    assert (jitter_mm < 0.75 * raw_mm).all()
    assert jitter_mm.max() < 3.0


@pytest.mark.parametrize(
    ("name", "amplitude", "hz"),
    [("l_knee", 0.5, 1.0), ("r_hip_y", 0.4, 1.0), ("r_elbow", 0.5, 2.0), ("head_z", 0.4, 0.5)],
)
def test_one_joint_that_moves_lags_by_a_frame_at_most(body, name, amplitude, hz) -> None:
    k = body.index(name)
    times = np.arange(240) * FRAME_NS * 1e-9
    poses = np.tile(body.neutral, (times.size, 1))
    poses[:, k] += amplitude * np.sin(2.0 * np.pi * hz * times)
    out = run(body, poses)[60:, k]
    gaps = [np.abs(out - np.roll(poses[:, k], lag)[60:]).mean() for lag in range(4)]
    assert np.argmin(gaps) <= 1


@pytest.mark.parametrize(("motion", "most_mm"), [("walk", 4.0), ("jog", 3.0)])
def test_who_moves_is_left_alone(body, motion, most_mm) -> None:
    """Every joint, also those whose angles hardly change."""
    made = Motion(body, motion)
    poses = np.array([made.pose(i / 60.0) for i in range(120)])
    apart_mm = np.linalg.norm(points_mm(body, run(body, poses)) - points_mm(body, poses), axis=2)
    assert apart_mm[30:].mean() < most_mm


@pytest.mark.parametrize("speed_m_s", [0.25, 0.5, 1.2])
def test_walking_off_lags_by_a_frame_at_most(body, speed_m_s) -> None:
    k = body.index("pelvis_tx")
    poses = np.tile(body.neutral, (120, 1))
    poses[:, k] = speed_m_s * np.arange(120) / 60.0
    lag_s = (poses[60:, k] - run(body, poses)[60:, k]) / speed_m_s
    assert lag_s.max() < 1.0 / 60.0


def test_a_gap_begins_anew(body) -> None:
    smooth = OneEuro(body)
    smooth(body.neutral, 0)
    later = body.neutral + 0.5
    np.testing.assert_array_equal(smooth(later, 10**9), later)


def test_what_was_taken_is_not_changed(body) -> None:
    smooth = OneEuro(body)
    first = body.neutral.copy()
    for i in range(3):
        smooth(first, i * FRAME_NS)
    np.testing.assert_array_equal(first, body.neutral)


def test_the_tracker_filters_what_it_shows_and_nothing_else(
    make_tracker, frames, refined_settings
) -> None:
    plain, filtered = (
        make_tracker({**refined_settings, "smoothing": name}) for name in ("none", "one_euro")
    )
    raw, shown = (
        [tracker.step(frame.observations, frame.stamp_ns) for frame in frames]
        for tracker in (plain, filtered)
    )
    smooth = OneEuro(filtered.body)
    for one, other in zip(raw, shown, strict=True):
        expected = smooth(one.pose, one.stamp_ns)
        np.testing.assert_allclose(other.pose, expected, atol=1e-12)
        np.testing.assert_allclose(other.markers_m, markers(filtered.body, other.pose), atol=1e-12)
        assert other.fitness == one.fitness
    assert np.abs(shown[-1].pose - raw[-1].pose).max() > 1e-6
    filtered.reset()
    again = filtered.step(frames[2].observations, frames[2].stamp_ns)
    fresh = make_tracker(refined_settings).step(frames[2].observations, frames[2].stamp_ns)
    np.testing.assert_array_equal(again.pose, fresh.pose)
