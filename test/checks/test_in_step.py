"""Offsets of cameras from motion alone."""

import numpy as np
import pytest

from markerless_tracker.checks.in_step import find_offsets

FPS = 30.0


def motions(late, *, frames=200, seed=0):
    """One motion seen by several cameras, each with its own gain, noise and frames late."""
    rng = np.random.default_rng(seed)
    steps = np.convolve(rng.standard_normal(frames + 100) ** 2, np.hanning(9), mode="same")
    return {
        f"cam{i:02d}": (0.5 + 0.3 * i) * steps[50 - d : 50 - d + frames] + 0.3 * rng.random(frames)
        for i, d in enumerate(late)
    }


@pytest.mark.parametrize("late", [(0, 0, 0, 0), (0, 7, 0, 0), (0, 0, -12, 0), (0, 4, 0, -5)])
def test_late_cameras_are_found(late) -> None:
    found = find_offsets(motions(late), FPS)
    expected = np.array(late) - np.median(late)
    np.testing.assert_allclose(list(found.frames.values()), expected, atol=0.6)
    assert min(found.correlation.values()) > 0.7
    gained = list(found.gained.values())
    assert max(gained) < 0.02 if not any(late) else gained[int(np.argmax(np.abs(late)))] > 0.3


def test_repeated_motion_has_several_offsets() -> None:
    time = np.arange(240)
    walk = 2.0 + np.sin(2.0 * np.pi * time / 20.0) + 0.4 * np.sin(2.0 * np.pi * time / 97.0)
    found = find_offsets({"a": walk[20:220], "b": walk[20:220], "c": walk[16:216]}, FPS)
    assert abs(found.frames["c"] - 4.0) < 0.6
    assert -16 in {round(x) for x in found.others["c"]}


def test_a_camera_without_the_motion_is_left_out() -> None:
    signals = motions((0, 0, 0))
    signals["cam02"] = np.random.default_rng(5).random(200)
    assert set(find_offsets(signals, FPS).frames) == {"cam00", "cam01"}
    signals["cam02"] = np.zeros(200)
    assert "cam02" not in find_offsets(signals, FPS).frames
    assert find_offsets({n: s[:10] for n, s in signals.items()}, FPS).frames == {}


def test_signals_of_different_motions_give_no_offset() -> None:
    """Smooth ones correlate by chance at one of many offsets."""
    smooth = np.hanning(31) / np.hanning(31).sum()
    for seed in range(20):
        rng = np.random.default_rng(seed)
        unlike = {
            name: 1.0 + np.convolve(rng.standard_normal(230), smooth, mode="valid")
            for name in "abc"
        }
        late = find_offsets(unlike, 60.0).frames
        assert all(abs(frames) < 5.0 for frames in late.values())
