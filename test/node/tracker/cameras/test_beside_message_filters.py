"""The synchronizer beside what users know from message_filters (table in docs/ros.md).

message_filters has no wheel. `Approximate` does what its class ApproximateTimeSynchronizer (Python,
Jazzy) does with the stamps of messages.
"""

from collections.abc import Iterable
from itertools import product

from hypothesis import given
from hypothesis import strategies as st

from markerless_tracker.node.tracker.synchronizer import RESTART_SETS, STOPPED_VIEWS, Synchronizer

CAMERAS = ("a", "b", "c")
PERIOD = 1000
Arrivals = Iterable[tuple[str, int]]


class Approximate:
    """Messages wait in a queue for each topic; a new one completes the nearest set within slop."""

    def __init__(self, slop: int, queue_size: int = 10) -> None:
        self.slop, self.queue_size = slop, queue_size
        self.queues: dict[str, set[int]] = {name: set() for name in CAMERAS}

    def add(self, camera: str, stamp: int) -> dict[str, int] | None:
        self.queues[camera].add(stamp)
        while len(self.queues[camera]) > self.queue_size:
            self.queues[camera].remove(min(self.queues[camera]))
        near = [
            [stamp]
            if name == camera
            else sorted(
                (s for s in queue if abs(s - stamp) <= self.slop), key=lambda s: abs(s - stamp)
            )
            for name, queue in self.queues.items()
        ]
        for chosen in product(*near):
            members = dict(zip(CAMERAS, chosen, strict=True))
            kept = all(members[name] in queue for name, queue in self.queues.items())
            if kept and max(chosen) - min(chosen) < self.slop:
                for name, queue in self.queues.items():
                    queue.remove(members[name])
                return members
        return None


def theirs(arrivals: Arrivals, slop: int, queue_size: int = 10) -> list[dict[str, int]]:
    made = Approximate(slop, queue_size)
    return [found for arrival in arrivals if (found := made.add(*arrival)) is not None]


def ours(arrivals: Arrivals, tolerance: int, seconds: float = 0.1) -> list[dict[str, int]]:
    """Sets of views that arrive one after the other at that distance."""
    made: Synchronizer[int] = Synchronizer(CAMERAS, tolerance_ns=tolerance)
    found = []
    for number, (camera, stamp) in enumerate(arrivals):
        if made.add(camera, stamp, stamp, now_s=number * seconds):
            matched = made.take()
            if matched is not None:
                found.append(dict(matched.views))
    return found


def in_turn(sets: Iterable[int], cameras: Iterable[str] = CAMERAS) -> list[tuple[str, int]]:
    names = tuple(cameras)
    return [(name, number * PERIOD) for number in sets for name in names]


@given(st.lists(st.lists(st.integers(0, 150), min_size=3, max_size=3), min_size=1, max_size=30))
def test_cameras_with_jitter_give_the_same_sets(jitter: list[list[int]]) -> None:
    arrivals = [
        (name, (number + 1) * PERIOD + late)
        for number, offsets in enumerate(jitter)
        for name, late in zip(CAMERAS, offsets, strict=True)
    ]
    found = ours(arrivals, 151)
    assert found == theirs(arrivals, 152)
    assert len(found) == len(jitter)


# So few sets that late ones are not taken for time that was set back.
@given(st.permutations(in_turn(range(RESTART_SETS))))
def test_whatever_the_order_each_of_our_sets_is_one_of_theirs(
    arrivals: list[tuple[str, int]],
) -> None:
    whole = [{name: number * PERIOD for name in CAMERAS} for number in range(RESTART_SETS)]
    assert sorted(theirs(arrivals, 1), key=lambda found: found["a"]) == whole
    found = ours(arrivals, 0)
    # Ours are in order; what lies before a complete set is dropped.
    assert all(one in whole for one in found) and found == sorted(found, key=lambda one: one["a"])


def test_equal_stamps_need_no_tolerance() -> None:
    assert len(ours(in_turn(range(5)), 0)) == 5
    assert theirs(in_turn(range(5)), 0) == []


def test_a_camera_that_stops_is_left_out_and_ends_theirs() -> None:
    arrivals = in_turn(range(1, 4)) + in_turn(range(4, 40), "ab")
    found = ours(arrivals, 0)
    assert set(found[-1]) == {"a", "b"} and len(found) >= 3 + 36 - STOPPED_VIEWS
    assert len(theirs(arrivals, 1)) == 3


def test_stamps_far_in_the_future_fill_their_queue() -> None:
    future = [("a", 10**9 + number) for number in range(10)]
    arrivals = in_turn(range(1, 3)) + future + in_turn(range(3, 30))
    assert len(ours(arrivals, 0)) == 29
    assert len(theirs(arrivals, 1)) == 2
    assert len(theirs(in_turn(range(1, 3)) + future[:9] + in_turn(range(3, 30)), 1)) == 29


def test_time_that_is_set_back_is_theirs_at_once_and_ours_with_the_third_set() -> None:
    arrivals = in_turn(range(100, 110)) + in_turn(range(10))
    assert len(theirs(arrivals, 1)) == 20
    assert len(ours(arrivals, 0)) == 20 - (RESTART_SETS - 1)
