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
    assert pace.wait_s(7_200 * MS) == pytest.approx(0.1 / rate)
    assert pace.shifted_s == pace.late_s == 0.0


def test_small_delays_do_not_add_up() -> None:
    clock = Clock()
    pace = Pace(1.0, clock=clock)
    for number in range(500):
        # Each set is sent 3 ms after its time.
        clock.now_s += pace.wait_s(number * 20 * MS) + 0.003
    assert clock.now_s == pytest.approx(100.0 + 499 * 0.02 + 0.003)


def test_a_delay_is_made_up_at_twice_the_rate_without_a_burst() -> None:
    clock = Clock()
    pace = Pace(1.0, clock=clock)
    pace.wait_s(0)
    clock.now_s += 0.5
    waits, lates = [], []
    for number in range(1, 12):
        waits.append(pace.wait_s(number * 100 * MS))
        lates.append(pace.late_s)
        clock.now_s += waits[-1]
    assert waits[0] == 0.0 and waits[1:7] == pytest.approx([0.05] * 6)
    assert lates[0] == pytest.approx(0.4) and lates[-1] == pytest.approx(0.0)
    assert clock.now_s == pytest.approx(101.1) and pace.shifted_s == 0.0


def test_a_long_delay_shifts_all_later_times() -> None:
    clock = Clock()
    pace = Pace(1.0, clock=clock)
    pace.wait_s(0)
    clock.now_s += 3.0
    assert pace.wait_s(100 * MS) == 0.0
    assert pace.shifted_s == pytest.approx(2.9) and pace.late_s == 0.0
    assert pace.wait_s(200 * MS) == pytest.approx(0.1)


def test_a_pause_is_no_delay() -> None:
    clock = Clock()
    pace = Pace(1.0, clock=clock)
    pace.wait_s(0)
    clock.now_s += 60.0
    pace.held(60.0)
    assert pace.wait_s(100 * MS) == pytest.approx(0.1)
    assert pace.shifted_s == pace.late_s == 0.0
