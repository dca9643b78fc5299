"""The share of skipped sets, by hand and against counts of every set."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from markerless_tracker.node.tracker.pace.skipping import EVERY_S, WINDOW_S, SkippedShare


def test_one_of_three_is_skipped() -> None:
    share = SkippedShare()
    shares = [share.update(100.0 + k, 20 * k, 10 * k) for k in range(8)]
    assert shares[:5] == [None] * 5
    assert shares[5:] == [pytest.approx(1 / 3)] * 3


def test_what_was_skipped_before_the_window_does_not_count() -> None:
    share = SkippedShare()
    shares = [share.update(1.0 * k, 10 * k, min(30, 10 * k)) for k in range(12)]
    assert shares[6] == (30 - 10) / (50 + 20)
    assert shares[8:] == [0.0] * 4


def test_without_sets_it_is_unknown() -> None:
    share = SkippedShare()
    assert [share.update(1.0 * k, 7, 3) for k in range(9)] == [None] * 9


@given(steps=st.lists(st.tuples(st.floats(0.0, 3.0), st.integers(0, 9), st.integers(0, 9))))
def test_it_is_a_share_over_about_the_window(steps: list[tuple[float, int, int]]) -> None:
    share, now_s, counts = SkippedShare(), 0.0, [(0.0, 0, 0)]
    share.update(*counts[0])
    for seconds, tracked, skipped in steps:
        now_s += seconds
        counts.append((now_s, counts[-1][1] + tracked, counts[-1][2] + skipped))
        found = share.update(*counts[-1])
        if found is None:
            continue
        old = [c for c in counts if now_s - c[0] >= WINDOW_S]
        latest = max(c[0] for c in old)
        begins = [c for c in old if c[0] >= latest - EVERY_S]
        made = [(b, counts[-1][1] - b[1], counts[-1][2] - b[2]) for b in begins]
        assert any(found == pytest.approx(s / (t + s)) for _, t, s in made if t + s)
