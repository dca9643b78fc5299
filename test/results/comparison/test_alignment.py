"""Alignment of the worlds and clocks of two tracks."""

import numpy as np
import pytest

from markerless_tracker.datasets import MarkerTrack
from markerless_tracker.errors import DatasetError
from markerless_tracker.results.comparison.alignment import align

NAMES = ("Head", "LWrist", "RKnee")
TIMES_S = np.arange(1200) / 20.0


def track(positions_m: np.ndarray, later_s: float = 0.0) -> MarkerTrack:
    """Markers at 20 Hz on a clock that is later by some seconds."""
    stamps = np.round((TIMES_S + later_s) * 1e9).astype(np.int64)
    return MarkerTrack(NAMES[: positions_m.shape[1]], stamps, positions_m)


def motion() -> np.ndarray:
    """(n, 3, 3) a minute of motion that does not repeat."""
    rng = np.random.default_rng(1)
    phase = TIMES_S[:, None, None] * rng.uniform(0.2, 6.0, (8, 1, 3, 3))
    waves = np.sin(phase + rng.uniform(0.0, 6.0, (8, 1, 3, 3))).sum(axis=0)
    return np.asarray(rng.normal(size=(3, 3)) + 0.1 * waves)


@pytest.mark.parametrize("later_s", [0.0, 3.2, 7.0, 10.0, -20.0, 1000.0])
def test_clocks_with_any_difference_are_aligned(later_s: float) -> None:
    """Both begin together, so that rows in common at a small offset do not show the motion."""
    found = align(track(motion()), track(motion(), later_s))
    assert found.offset_s == pytest.approx(later_s, abs=1e-3)
    assert found.rms_mm < 1.0


def test_one_clock_needs_no_equal_beginnings() -> None:
    positions = motion()
    found = align(track(positions).rows(slice(400, 900)), track(positions))
    assert found.offset_s == pytest.approx(0.0, abs=1e-3)
    assert found.rms_mm < 1.0


@pytest.mark.parametrize("shown", [slice(300, 700), slice(800, 1200)])
def test_less_than_half_of_the_result_may_be_compared(shown: slice) -> None:
    """The result has blank rows, or the reference is shorter."""
    whole = motion()
    blank = np.full_like(whole, np.nan)
    blank[shown] = whole[shown]
    for pair in (
        (track(blank), track(whole, 0.35)),
        (track(whole), track(whole, 0.35).rows(shown)),
    ):
        found = align(*pair)
        assert found.offset_s == pytest.approx(0.35, abs=1e-3)
        assert found.rms_mm < 1.0


def test_motion_without_enough_rows_in_common_is_refused() -> None:
    one, other = motion(), motion()
    one[400:1100], other[:400] = np.nan, np.nan
    other[1150:] = np.nan
    with pytest.raises(DatasetError, match="at no time offset is half of the result's or the ref"):
        align(track(one), track(other))


@pytest.mark.parametrize("flat", ["result", "reference"])
def test_positions_on_one_line_show_no_rotation_about_it(flat: str) -> None:
    walk = np.zeros((1200, 1, 3))
    walk[:, 0, 0] = 0.1 * TIMES_S + np.sin(TIMES_S)
    beside = walk.copy()
    beside[:, 0, 1] = 0.2 * np.sin(2.0 * TIMES_S)
    assert align(track(beside), track(beside)).rms_mm < 1.0
    pair = (walk, beside) if flat == "result" else (beside, walk)
    with pytest.raises(DatasetError, match="cannot align: all positions of Head lie on one line"):
        align(*map(track, pair))
