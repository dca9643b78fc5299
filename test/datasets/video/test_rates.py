"""Rates and stamps."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from markerless_tracker.datasets import every_for_fps, stamp_of, tidy_fps
from markerless_tracker.errors import ConfigError


@pytest.mark.parametrize(
    ("stored", "meant"),
    [
        (60.0, 60.0),
        (59.9999, 60.0),
        (59.94, 60000 / 1001),
        (29.97, 30000 / 1001),
        (23.976, 24000 / 1001),
        (12.5, 12.5),
        (33.3333, 33.333),
        (0.5, 0.5),
    ],
)
def test_nominal_rates(stored: float, meant: float) -> None:
    assert tidy_fps(stored) == meant


@given(st.sampled_from([24000 / 1001, 25.0, 30000 / 1001, 50.0, 59.3, 60000 / 1001, 60.0, 120.0]))
def test_a_rate_measured_from_stamps_is_the_same_float(fps: float) -> None:
    stamps = [stamp_of(i, fps) for i in range(3)]
    assert tidy_fps(1e9 / ((stamps[2] - stamps[0]) / 2)) == tidy_fps(fps)


def test_stamps_are_rounded_once() -> None:
    assert [stamp_of(i, 60.0) for i in range(4)] == [0, 16666667, 33333333, 50000000]


@pytest.mark.parametrize(
    ("wanted", "every"), [(None, 1), (60.0, 1), (30.0, 2), (20.0, 3), (12.0, 5), (59.94, 1)]
)
def test_every_kth_frame(wanted: float | None, every: int) -> None:
    assert every_for_fps(60.0, wanted) == every


@pytest.mark.parametrize(("wanted", "every"), [(60.0, 1), (30.0, 2), (20.0, 3)])
def test_the_rates_of_television_give_the_whole_ones(wanted: float, every: int) -> None:
    assert every_for_fps(60000 / 1001, wanted) == every
    with pytest.raises(ConfigError, match="at most the source's 59"):
        every_for_fps(59.0, 60.0)


def test_impossible_rates_name_the_nearest_possible() -> None:
    with pytest.raises(ConfigError, match="20 or 30|30 or 20"):
        every_for_fps(60.0, 25.0)
    for impossible in (0.0, -1.0, 120.0, float("nan"), float("inf")):
        with pytest.raises(ConfigError, match="expected"):
            every_for_fps(60.0, impossible)
