from typing import Any

import pytest

from markerless_tracker.node.player.lockstep import Lockstep


class Clock:
    def __init__(self) -> None:
        self.now_s = 100.0

    def __call__(self) -> float:
        return self.now_s


def state(dealt_ns: int | None, *, ready: bool = True) -> dict[str, str]:
    return {
        "ready": "true" if ready else "false",
        "dealt_with_ns": "" if dealt_ns is None else str(dealt_ns),
    }


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def lockstep(clock: Clock) -> Lockstep:
    return Lockstep(10.0, clock=clock)


def test_the_next_set_is_due_when_all_trackers_have_dealt_with_the_last(lockstep: Any) -> None:
    lockstep.update("a", state(None))
    lockstep.update("b", state(None))
    lockstep.sent(0)
    assert lockstep.waiting_for() == ["a", "b"]
    lockstep.update("a", state(0))
    assert lockstep.waiting_for() == ["b"]
    lockstep.update("b", state(0))
    assert lockstep.waiting_for() == []
    # Time is set back when a bag is played again.
    lockstep.sent(100)
    lockstep.update("b", state(100))
    lockstep.sent(50)
    assert lockstep.waiting_for() == ["a", "b"]


def test_without_a_ready_tracker_nothing_is_waited_for(lockstep: Any) -> None:
    lockstep.sent(1)
    assert lockstep.alone and lockstep.waiting_for() == []
    lockstep.update("a", state(None, ready=False))
    lockstep.update("other", {"level": "3"})
    lockstep.update("other", {"ready": "true", "dealt_with_ns": "soon"})
    assert lockstep.alone and lockstep.waiting_for() == []
    lockstep.update("a", state(None))
    assert not lockstep.alone and lockstep.waiting_for() == ["a"]


def test_a_tracker_that_lets_a_set_time_out_is_not_waited_for_until_it_works(
    lockstep: Any, clock: Clock
) -> None:
    lockstep.update("a", state(None))
    lockstep.update("b", state(None))
    lockstep.sent(1)
    lockstep.update("b", state(1))
    clock.now_s += 9.0
    lockstep.update("a", state(None))
    assert lockstep.overdue() == []
    clock.now_s += 2.0
    lockstep.update("b", state(1))
    assert lockstep.overdue() == ["a"] and lockstep.overdue() == []
    assert lockstep.waiting_for() == []
    lockstep.sent(2)
    assert lockstep.waiting_for() == ["b"]
    lockstep.update("a", state(2))
    lockstep.sent(3)
    assert lockstep.waiting_for() == ["a", "b"]


def test_a_tracker_that_is_no_longer_heard_is_forgotten(lockstep: Any, clock: Clock) -> None:
    lockstep.update("a", state(None))
    lockstep.sent(1)
    clock.now_s += 10.5
    assert lockstep.waiting_for() == [] and lockstep.alone and lockstep.overdue() == []
