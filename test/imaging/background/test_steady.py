import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from markerless_tracker.imaging.background.steady import (
    matching_frames,
    motion,
    steady_image,
    thinned,
)


def twin(values: np.ndarray, share: float) -> np.ndarray:
    """The steady value of one pixel, values (n, c)."""
    order = np.argsort(values.sum(axis=1), kind="stable")
    bright = values.sum(axis=1)[order].astype(int)
    need = max(1, int(np.ceil(share * len(values))))
    lengths = [bright[i + need - 1] - bright[i] for i in range(len(values) - need + 1)]
    first = int(np.argmin(lengths))
    window = values[order[first : first + need]]
    tolerance = max(6.0, 3.0 * min(lengths) / values.shape[1])
    near = np.abs(window - window.mean(axis=0)).max(axis=1) <= 2.0 * tolerance
    return window[near].mean(axis=0) if near.any() else window.mean(axis=0)


@given(st.integers(0, 2**32 - 1), st.integers(1, 12), st.sampled_from([0.1, 0.4, 0.5, 1.0]))
def test_agrees_with_one_pixel_at_a_time(seed: int, count: int, share: float) -> None:
    stack = np.random.default_rng(seed).integers(0, 256, (count, 3, 4, 3), dtype=np.uint8)
    steady, variance = steady_image(stack, share=share)
    for v, u in np.ndindex(3, 4):
        assert steady[v, u] == pytest.approx(twin(stack[:, v, u].astype(float), share), abs=1e-3)
    assert np.isfinite(variance).all() and (variance >= 0).all()


def test_brief_covers_are_ignored_and_noise_is_measured() -> None:
    rng = np.random.default_rng(2)
    stack = np.rint(100.0 + rng.normal(0.0, 3.0, (40, 8, 9, 3))).astype(np.uint8)
    stack[:18] = rng.integers(0, 256, (18, 8, 9, 3))
    steady, variance = steady_image(stack)
    assert np.abs(steady - 100.0).max() < 4.0
    assert 2.0 < np.sqrt(np.median(variance)) < 4.5


def test_matching_frames_counts_and_averages() -> None:
    stack = np.zeros((5, 1, 2, 1), np.uint8)
    stack[:, 0, 0, 0] = [10, 12, 50, 14, 90]
    matches, mean = matching_frames(stack, np.full((1, 2, 1), 12.0, np.float32), 2.0)
    assert matches.tolist() == [[3, 0]]
    assert mean[0, :, 0].tolist() == [12.0, 12.0]


def test_motion_measures_how_often_and_how_abruptly() -> None:
    stack = np.full((10, 1, 2, 1), 100, np.uint8)
    stack[:, 0, 0, 0] = [100, 100, 105, 110, 115, 120, 125, 130, 135, 140]  # light
    stack[4:6, 0, 1, 0] = 30  # a body passes
    share, jump = motion(stack, np.full((1, 2, 1), 100.0, np.float32), 14.0)
    assert share[0].tolist() == pytest.approx([0.6, 0.2])
    assert jump[0].tolist() == [5.0, 70.0]


@given(st.integers(0, 300), st.integers(2, 40))
def test_thinned_spreads_evenly_over_any_length(length: int, most: int) -> None:
    frames = [np.full((1, 1), i % 256, np.uint8) for i in range(length)]
    kept = [index for index, _ in thinned(iter(frames), most)]
    assert len(kept) <= most
    if length:
        strides = {b - a for a, b in zip(kept, kept[1:], strict=False)}
        assert kept[0] == 0 and len(strides) <= 1
        assert len(kept) >= min(length, most // 2)
        assert length - kept[-1] <= max(strides, default=1)
