from collections.abc import Callable

import pytest

from markerless_tracker.node.tracker.pace.effort import (
    EARLY_SETS,
    LATE_SETS,
    LEAST,
    OLD_S,
    EffortRule,
    Lateness,
)

PERIOD_S = 1.0 / 60.0


def simulate(cost_s: Callable[[float, int], float], sets: int) -> tuple[list[float], list[float]]:
    """Efforts and ages of the sets that a worker takes, newest first, of a stream of 60 a second.

    `cost_s(effort, number)` is the time spent on a set.
    """
    rule = EffortRule()
    efforts, ages = [], []
    free_s, last = 0.0, -1
    while True:
        newest = int(free_s / PERIOD_S + 1e-9)
        number = max(newest, last + 1)
        if number >= sets:
            return efforts, ages
        arrived_s = number * PERIOD_S
        taken_s = max(free_s, arrived_s)
        lateness = Lateness(number - last - 1, taken_s - free_s, taken_s - arrived_s, PERIOD_S)
        efforts.append(rule.take(lateness))
        ages.append(lateness.age_s)
        free_s, last = taken_s + cost_s(efforts[-1], number), number


def test_in_time_everything_is_spent() -> None:
    efforts, _ = simulate(lambda effort, _: 0.9 * PERIOD_S * effort, 200)
    assert set(efforts) == {1.0} and len(efforts) == 200


def test_too_many_sets_lower_the_effort_until_all_are_tracked_and_it_stays_there() -> None:
    efforts, _ = simulate(lambda effort, _: 2.0 * PERIOD_S * effort, 600)
    settled = efforts[60:]
    assert max(settled) * 2.0 <= 1.2 and min(settled) >= 0.3
    # It tries more now and then, no more often than every `EARLY_SETS` sets.
    changes = sum(a != b for a, b in zip(settled, settled[1:], strict=False))
    assert changes <= 2 * len(settled) / EARLY_SETS
    assert len(efforts) > 560


def test_one_long_search_changes_nothing() -> None:
    efforts, _ = simulate(
        lambda effort, number: 5 * PERIOD_S if number == 50 else 0.5 * PERIOD_S, 99
    )
    assert set(efforts) == {1.0}


def test_a_set_that_waited_for_a_first_search_lowers_the_effort_at_once() -> None:
    rule = EffortRule()
    assert rule.take(Lateness(0, 0.0, 0.9 * OLD_S, PERIOD_S)) == 1.0
    rule = EffortRule()
    assert rule.take(Lateness(0, 0.0, 1.1 * OLD_S, PERIOD_S)) == LEAST


def test_it_never_falls_below_the_least_and_recovers() -> None:
    rule = EffortRule()
    for _ in range(99):
        rule.take(Lateness(left_out=9, waited_s=0.0, age_s=0.0, period_s=PERIOD_S))
    assert rule.effort == LEAST
    for _ in range(20 * EARLY_SETS):
        rule.take(Lateness(left_out=0, waited_s=0.5 * PERIOD_S, age_s=0.0, period_s=PERIOD_S))
    assert rule.effort == 1.0


@pytest.mark.parametrize(
    ("lateness", "late", "early"),
    [
        (Lateness(1, 0.0, 0.0, PERIOD_S), True, False),
        (Lateness(0, 0.0, 1.5 * PERIOD_S, PERIOD_S), True, False),
        (Lateness(0, 0.0, 0.5 * PERIOD_S, PERIOD_S), False, False),
        (Lateness(0, 0.1 * PERIOD_S, 0.0, PERIOD_S), False, False),
        (Lateness(0, 0.3 * PERIOD_S, 0.0, PERIOD_S), False, True),
    ],
)
def test_between_late_and_early_there_is_a_band(
    lateness: Lateness, late: bool, early: bool
) -> None:
    assert (lateness.late, lateness.early) == (late, early)
    rule = EffortRule()
    for _ in range(LATE_SETS):
        rule.take(lateness)
    assert (rule.effort < 1.0) == late
