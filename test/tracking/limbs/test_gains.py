"""The sum of gains against steps worked by hand."""

import pytest

from markerless_tracker.tracking.limbs.gains import GainSum


def test_gains_add_up_and_are_forgotten() -> None:
    gains = GainSum()
    assert (gains.total, gains.count, gains.mean) == (0.0, 0, 0.0)
    gains.add(0.01)
    assert (gains.total, gains.count) == (0.01, 1)
    gains.add(0.005)
    # 0.9 * 0.01 + 0.005
    assert (gains.total, gains.count) == (pytest.approx(0.014), 2)
    assert gains.mean == pytest.approx(0.007)
    # 0.9 * 0.014 - 0.002
    gains.add(-0.002)
    assert (gains.total, gains.count) == (pytest.approx(0.0106), 3)


def test_a_clear_loss_begins_the_sum_anew() -> None:
    gains = GainSum()
    gains.add(0.01)
    gains.add(-0.02)
    assert (gains.total, gains.count, gains.mean) == (0.0, 0, 0.0)
