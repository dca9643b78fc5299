import pytest

from markerless_tracker.node.player.pace import Pace

MS = 1_000_000


class Clock:
    def __init__(self) -> None:
        self.now_s = 100.0

    def __call__(self) -> float:
        return self.now_s


@pytest.mark.parametrize("rate", [0.5, 1.0, 4.0])
def test_sets_are_due_at_their_own_times_over_the_rate(rate: float) -> None:
    clock = Clock()
    pace = Pace(rate, clock=clock)
    assert pace.wait_s(7_000 * MS) == 0.0
    assert pace.wait_s(7_100 * MS) == pytest.approx(0.1 / rate)
    clock.now_s += 0.1 / rate
    assert pace.wait_s(7_100 * MS) == pytest.approx(0.0, abs=1e-9)
    assert pace.late_s == 0.0


def test_a_short_delay_is_caught_up_and_a_long_one_is_not_made_up_by_a_burst() -> None:
    clock = Clock()
    pace = Pace(1.0, clock=clock, slack_s=0.05)
    pace.wait_s(0)
    clock.now_s += 0.12
    assert pace.wait_s(100 * MS) == 0.0
    assert pace.wait_s(200 * MS) == pytest.approx(0.08) and pace.late_s == 0.0
    clock.now_s += 1.0
    assert pace.wait_s(200 * MS) == 0.0
    assert pace.late_s == pytest.approx(0.92)
    assert pace.wait_s(300 * MS) == pytest.approx(0.1)
