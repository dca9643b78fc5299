"""Tests for `markerless_tracker.tracking.person.spread`."""

import numpy as np

from markerless_tracker.tracking.person.spread import EvenlySpread, most_different


def test_items_are_evenly_spread_whatever_their_number() -> None:
    spread: EvenlySpread[int] = EvenlySpread(8)
    made: list[int] = []
    for number in range(101):
        spread.offer(lambda number=number: made.append(number) or number)  # type: ignore[misc]
    assert spread.items == [0, 16, 32, 48, 64, 80, 96]
    assert len(made) < 40


def test_the_most_different_ones() -> None:
    at = np.array([0.0, 0.1, 0.2, 5.0, 0.3, 9.0, 8.9])
    chosen = most_different(len(at), 3, lambda i: np.abs(at - at[i]))
    # The middle one, then the farthest from it, then the farthest from both.
    assert chosen == [3, 0, 5]
    assert sorted(most_different(2, 9, lambda i: np.abs(at[:2] - at[i]))) == [0, 1]
    assert most_different(0, 3, lambda i: at) == []
