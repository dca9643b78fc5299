"""Tests for `markerless_tracker.node.tracker.pace.ahead`."""

import threading
from collections.abc import Iterator
from typing import Any

import pytest

from markerless_tracker.node.tracker.pace.ahead import Ahead, Taken
from markerless_tracker.node.tracker.pace.waiting import MatchedSet
from markerless_tracker.node.tracker.synchronizer import Synchronizer


class Bench:
    """Sets of one camera, and what was made of them in which thread."""

    def __init__(self) -> None:
        self.sets: Synchronizer[int] = Synchronizer(("a",))
        self.made: list[tuple[int, int]] = []
        self.making = threading.Event()
        self.now_s = 0.0
        self.ahead = Ahead(self.sets, self._make, poll_s=60.0, clock=lambda: self.now_s)

    def _make(self, matched: MatchedSet[Any]) -> str:
        self.made.append((matched.stamp_ns, threading.get_ident()))
        self.making.set()
        if matched.stamp_ns == 13:
            raise ValueError("no evidence")
        return f"evidence {matched.stamp_ns}"

    def offer(self, *stamps_ns: int) -> None:
        for stamp_ns in stamps_ns:
            self.sets.add("a", stamp_ns, 0, now_s=0.0)

    def next(self) -> Taken:
        taken = self.ahead.next()
        assert taken is not None
        return taken


@pytest.fixture
def bench() -> Iterator[Bench]:
    bench = Bench()
    yield bench
    bench.ahead.close()


def test_a_set_is_made_in_another_thread_while_one_is_fitted(bench) -> None:
    bench.offer(1)
    assert bench.next().made == "evidence 1"
    bench.ahead.fitting()
    bench.making.clear()
    bench.offer(2)
    assert bench.making.wait(60.0)
    bench.ahead.fitted()
    assert bench.next().made == "evidence 2"
    (_, first), (_, second) = bench.made
    assert first == threading.get_ident() != second


def _fit_while_sets_come(bench: Bench, fit_s: float) -> None:
    """One set is fitted for so long; the evidence of the next is made, and two more come."""
    bench.offer(1)
    bench.next()
    bench.ahead.fitting()
    bench.making.clear()
    bench.offer(2)
    assert bench.making.wait(60.0)
    bench.offer(3, 4)
    bench.now_s += fit_s
    bench.ahead.fitted()


@pytest.mark.parametrize("fit_s", [0.1, 2.0])
def test_evidence_that_is_ready_is_used_however_long_it_waited(bench, fit_s) -> None:
    _fit_while_sets_come(bench, fit_s)
    assert bench.next().matched.stamp_ns == 2
    assert bench.next().matched.stamp_ns == 4
    assert [stamp_ns for stamp_ns, _ in bench.made] == [1, 2, 4]
    assert bench.sets.counts.skipped == 1


def test_an_error_comes_with_its_set(bench) -> None:
    bench.offer(13)
    taken = bench.next()
    assert taken.matched.stamp_ns == 13
    assert str(taken.error) == "no evidence"


def test_a_set_that_was_taken_and_not_fitted_is_told_at_the_end(bench) -> None:
    bench.offer(1)
    bench.next()
    bench.ahead.fitting()
    bench.offer(2, 3)
    assert bench.making.wait(60.0)
    assert bench.ahead.close() + bench.sets.drop_all() + bench.sets.counts.skipped == 2
    assert bench.ahead.close() == bench.sets.drop_all() == 0


def test_without_a_set_there_is_nothing() -> None:
    sets: Synchronizer[int] = Synchronizer(("a",))
    ahead = Ahead(sets, lambda _: None, poll_s=0.0)
    assert ahead.next() is None
    assert ahead.close() == 0
