"""Limbs that are searched one after the other."""

import numpy as np
import pytest

from markerless_tracker.tracking.limbs.round_robin import PER_LIMB_NS, RoundRobin

LIMBS = ("l_arm", "r_arm", "l_leg", "r_leg")


def taken(every_ns: int, count: int, *, put_off: bool = False) -> list[list[str]]:
    """The limbs of frames at intervals, without the first frame."""
    limbs = RoundRobin()
    assert limbs.take(LIMBS) == ["l_arm"]
    return [next_of(limbs, every_ns, put_off=put_off) for _ in range(count)]


def next_of(limbs: RoundRobin, since_ns: int, **how) -> list[str]:
    limbs.advance(since_ns)
    return limbs.take(LIMBS, **how)


@pytest.mark.parametrize(
    ("rate", "per_second"), [(60.0, 10.4), (30.0, 20.8), (20.0, 31.2), (12.0, 48.0), (5.0, 20.0)]
)
def test_limbs_grow_in_number_with_the_square_of_the_time_between_frames(rate, per_second) -> None:
    frames = taken(round(1e9 / rate), round(4 * rate))
    assert sum(map(len, frames)) / 4 == pytest.approx(per_second, abs=0.5)
    assert max(map(len, frames)) - min(map(len, frames)) <= 1


def test_every_limb_is_due_once() -> None:
    names = [name for frame in taken(16_666_667, 100) for name in frame]
    assert names[:5] == ["r_arm", "l_leg", "r_leg", "l_arm", "r_arm"]
    assert all(len(set(frame)) == 4 for frame in taken(10 * PER_LIMB_NS, 3))


def test_a_limb_that_can_wait_is_put_off_and_comes_alone() -> None:
    frames = taken(16_666_667, 60, put_off=True)
    at = [number for number, frame in enumerate(frames) if frame]
    assert len(at) == 5 and all(len(frames[number]) == 1 for number in at)
    assert np.diff(at).min() >= 11


def test_one_limb_at_most_has_its_turn_where_there_is_no_time_for_more() -> None:
    limbs = RoundRobin()
    names = [next_of(limbs, 10 * PER_LIMB_NS, single=True) for _ in range(5)]
    assert names == [["l_arm"], ["r_arm"], ["l_leg"], ["r_leg"], ["l_arm"]]


def test_a_turn_is_not_lost_in_frames_that_search_no_limb() -> None:
    limbs = RoundRobin()
    names = []
    for number in range(8):
        limbs.advance(PER_LIMB_NS)
        if number % 2:
            names += limbs.take(LIMBS, single=True)
    assert names == ["l_arm", "r_arm", "l_leg", "r_leg"]
