"""Which sets wait, by their stamps in milliseconds."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from markerless_tracker.node.tracker.pace.waiting import (
    AT_MOST,
    CLOSE,
    MOST_BYTES,
    PLACE_NS,
    SPACING_NS,
    MatchedSet,
    WaitingSets,
    kept_sets,
)

MS = 1_000_000
FRAME_MS = 20


def a_set(stamp_ms: int, *, restarted: bool = False) -> MatchedSet[str]:
    return MatchedSet(stamp_ms * MS, {"a": "view"}, 0.001 * stamp_ms, restarted)


def drained(waiting: WaitingSets[str]) -> list[int]:
    """Stamps of the sets that wait, ms."""
    taken = []
    while (matched := waiting.take()) is not None:
        taken.append(matched.stamp_ns // MS)
    return taken


def test_the_newest_set_alone_waits() -> None:
    waiting: WaitingSets[str] = WaitingSets()
    assert [waiting.put(a_set(stamp)) for stamp in (0, 100, 200)] == [0, 1, 1]
    matched = waiting.take()
    assert matched is not None and (matched.stamp_ns, matched.replaced) == (200 * MS, 2)
    assert waiting.take() is None


@pytest.mark.parametrize(
    "followed, expected",
    [(False, [60, 120, 180, 240, 300]), (True, [80, 160, 240, 300])],
)
def test_kept_sets_lie_apart_and_come_in_order(followed: bool, expected: list[int]) -> None:
    waiting: WaitingSets[str] = WaitingSets()
    waiting.keep(AT_MOST)
    waiting.keep(AT_MOST, followed=followed)
    waiting.put(a_set(0))
    assert drained(waiting) == [0]
    replaced = [waiting.put(a_set(stamp)) for stamp in range(FRAME_MS, 320, FRAME_MS)]
    assert waiting.views == len(waiting)
    stamps = drained(waiting)
    # The newest may lie nearer.
    assert stamps == expected
    assert sum(replaced) == len(replaced) - len(stamps)


def test_of_too_many_every_other_of_the_later_ones_is_dropped() -> None:
    waiting: WaitingSets[str] = WaitingSets()
    waiting.keep(CLOSE + 4, followed=True)
    replaced = [waiting.put(a_set(stamp)) for stamp in range(0, 1700, 100)]
    assert sum(replaced) == 17 - len(waiting) == 6
    taken = list(iter(waiting.take, None))
    early = list(range(0, 100 * CLOSE, 100))
    assert [matched.stamp_ns // MS for matched in taken] == [*early, 1100, 1500, 1600]
    assert [matched.replaced for matched in taken] == [0] * CLOSE + [3, 3, 0]
    # The next start begins with close ones.
    waiting.keep(0)
    waiting.keep(CLOSE)
    for stamp in (2000, 2100, 2200):
        waiting.put(a_set(stamp))
    assert drained(waiting) == [2000, 2100, 2200]


def test_with_few_places_the_oldest_are_dropped() -> None:
    waiting: WaitingSets[str] = WaitingSets()
    waiting.keep(3)
    waiting.put(a_set(0, restarted=True))
    assert [waiting.put(a_set(stamp)) for stamp in (100, 200, 300)] == [0, 0, 1]
    matched = waiting.take()
    assert matched is not None and matched.stamp_ns == 100 * MS
    assert matched.replaced == 1 and matched.restarted
    assert drained(waiting) == [200, 300]


def test_images_that_fill_the_memory_are_kept_less() -> None:
    assert kept_sets(1) == AT_MOST and kept_sets(MOST_BYTES // 5) == 5
    assert kept_sets(2 * MOST_BYTES) == 1


def test_without_a_person_the_older_sets_are_dropped() -> None:
    waiting: WaitingSets[str] = WaitingSets()
    waiting.keep(AT_MOST)
    for stamp in (0, 100, 200):
        waiting.put(a_set(stamp))
    assert waiting.drop_older() == 2 and waiting.drop_older() == 0
    matched = waiting.take()
    assert matched is not None and (matched.stamp_ns, matched.replaced) == (200 * MS, 2)


def test_after_a_start_that_failed_sets_lie_as_close_as_before_the_first() -> None:
    waiting: WaitingSets[str] = WaitingSets()
    waiting.keep(AT_MOST, followed=True)
    waiting.keep(AT_MOST)
    for stamp in range(0, 320, FRAME_MS):
        waiting.put(a_set(stamp))
    assert drained(waiting) == [0, 60, 120, 180, 240, 300]


@pytest.mark.parametrize("waits, expected", [(0, [400]), (1, [400]), (2, [200, 300, 400])])
def test_nothing_is_caught_up_if_the_newest_set_alone_waits(
    waits: int, expected: list[int]
) -> None:
    waiting: WaitingSets[str] = WaitingSets()
    waiting.keep(AT_MOST)
    for number in range(waits):
        waiting.put(a_set(80 * number))
    waiting.keep(0)
    for stamp in (200, 300, 400):
        waiting.put(a_set(stamp))
    assert drained(waiting) == expected


def catch_up(step_ms: int, kept: int) -> list[int]:
    """Ages of the sets when they are taken, ms, by a worker that takes so long for each."""
    waiting: WaitingSets[str] = WaitingSets()
    waiting.keep(AT_MOST)
    end_ms = 100 * kept
    for now_ms in range(0, end_ms, FRAME_MS):
        waiting.put(a_set(now_ms))
    waiting.keep(0)
    ages, busy_until = [], end_ms
    for now_ms in range(end_ms, end_ms + 20_000, FRAME_MS):
        waiting.put(a_set(now_ms))
        if now_ms >= busy_until and (matched := waiting.take()) is not None:
            ages.append(now_ms - matched.stamp_ns // MS)
            busy_until = now_ms + step_ms
    return ages


def test_a_fast_worker_catches_up_with_every_set_that_was_kept() -> None:
    ages = catch_up(40, 10)
    assert ages[0] > 800 and ages[-1] == 0
    # What it gains on the images, set by set.
    late = [age for age in ages if age > 2 * FRAME_MS]
    assert late == sorted(late, reverse=True) and len(late) >= 15


def test_a_slow_worker_catches_up_all_the_same() -> None:
    for step_ms in (80, 200, 1000):
        ages = catch_up(step_ms, AT_MOST)
        assert max(ages) >= 1500 and ages[-1] <= FRAME_MS


EVENTS = st.sampled_from(["put", "take", "keep", "end", "drop"])


@given(st.lists(st.tuples(EVENTS, st.integers(1, 400)), max_size=120), st.integers(1, 14))
def test_sets_are_bounded_in_order_and_all_accounted_for(
    events: list[tuple[str, int]], at_most: int
) -> None:
    waiting: WaitingSets[str] = WaitingSets()
    stamp_ms = put = taken = lost = replaced = 0
    last = -1
    for event, value in events:
        if event == "put":
            stamp_ms += value
            put += 1
            lost += waiting.put(a_set(stamp_ms))
        elif event == "take" and (matched := waiting.take()) is not None:
            assert matched.stamp_ns > last
            last, taken, replaced = matched.stamp_ns, taken + 1, replaced + matched.replaced
        elif event == "drop":
            lost += waiting.drop_older()
        elif event in ("keep", "end"):
            waiting.keep(at_most if event == "keep" else 0)
        assert len(waiting) <= max(at_most, 1)
    for matched in iter(waiting.take, None):
        taken, replaced = taken + 1, replaced + matched.replaced
    assert put == taken + lost and replaced == lost


def test_places_are_lost_with_time() -> None:
    """The last place is lost so long after the end that even a slow worker is no longer behind."""
    waiting: WaitingSets[str] = WaitingSets()
    waiting.keep(AT_MOST)
    for number in range(6):
        waiting.put(a_set(number * SPACING_NS // MS))
    waiting.keep(0)
    for number in range(6, 100):
        waiting.put(a_set(number * SPACING_NS // MS))
        behind_ns = (number - 5) * SPACING_NS
        assert len(waiting) <= max(1, 8 - behind_ns // PLACE_NS)
    assert len(waiting) == 1


def test_sets_of_a_time_that_was_set_back_end_the_catching_up() -> None:
    waiting: WaitingSets[str] = WaitingSets()
    waiting.keep(AT_MOST)
    for stamp in range(5000, 6000, 100):
        waiting.put(a_set(stamp))
    waiting.keep(0)
    waiting.put(a_set(100, restarted=True))
    waiting.put(a_set(200))
    matched = waiting.take()
    assert matched is not None and matched.stamp_ns == 200 * MS and matched.restarted
    assert len(waiting) == 0


@pytest.mark.parametrize("taken", [0, 1, 3])
def test_sets_of_a_time_that_was_set_back_are_kept_alone(taken: int) -> None:
    waiting: WaitingSets[str] = WaitingSets()
    waiting.keep(AT_MOST)
    for stamp in (5000, 5100, 5200):
        waiting.put(a_set(stamp))
    for _ in range(taken):
        waiting.take()
    assert waiting.put(a_set(100, restarted=True)) == 3 - taken
    assert [waiting.put(a_set(stamp)) for stamp in (200, 300)] == [0, 0]
    matched = waiting.take()
    assert matched is not None and matched.stamp_ns == 100 * MS
    assert matched.restarted and matched.replaced == 3 - taken
    assert drained(waiting) == [200, 300]


def test_sets_of_a_time_that_was_set_back_lie_close() -> None:
    waiting: WaitingSets[str] = WaitingSets()
    waiting.keep(CLOSE + 1)
    for stamp in range(5000, 7000, 100):
        waiting.put(a_set(stamp))
    waiting.put(a_set(100, restarted=True))
    assert [waiting.put(a_set(stamp)) for stamp in (160, 220)] == [0, 0]
    assert drained(waiting) == [100, 160, 220]
