"""Which of two opposite headings leads, from costs and movements written by hand."""

import math

import numpy as np
import pytest

from markerless_tracker.tracking.start.two_headings import (
    COMPARED,
    MOST_FRAMES,
    SETTLING_FRAMES,
    SIZED_FROM,
    HeadingFit,
    TwoHeadings,
)

FRAME_NS = 40_000_000
STANDS = np.zeros(3)


def fit(cost: float, trunk_m: np.ndarray = STANDS) -> HeadingFit:
    return HeadingFit(None, np.zeros(1), cost, trunk_m)


def changes(
    costs: list[tuple[float | None, float | None]], heading_rad: float = 0.0, walks_m: float = 0.0
) -> list[int]:
    """Numbers of the frames after which the other heading leads; the person walks along x."""
    both = TwoHeadings(heading_rad)
    found = []
    for number, pair in enumerate(costs):
        at = np.array([walks_m * number, 0.0, 0.0])
        first, opposite = (None if cost is None else fit(cost, at) for cost in pair)
        both.note(number * FRAME_NS, (first, opposite))
        if both.change():
            found.append(number)
    assert both.over == (len(costs) >= SETTLING_FRAMES)
    assert both.leading_rad == heading_rad + math.pi * (len(found) % 2)
    return found


def test_the_heading_that_explains_the_frames_better_leads() -> None:
    assert changes([(0.1, 0.1)] * SETTLING_FRAMES) == []
    assert changes([(0.1, 0.08)] * SETTLING_FRAMES) == [SIZED_FROM]


def test_a_person_who_turns_keeps_the_heading() -> None:
    both = TwoHeadings(0.0)
    for number in range(SETTLING_FRAMES):
        # 25 degrees a frame: a quick turn at 5 frames/s.
        heading_rad = math.radians(25.0) * number
        near = [math.cos(rad - heading_rad) > 0.0 for rad in both.both_rad]
        assert near == [True, False]
        both.note(number * FRAME_NS, (fit(0.1), fit(0.13)))
        assert not both.change()
        both.follow(heading_rad)
    assert abs(both.leading_rad - heading_rad) < 0.51


def test_poses_that_differ_a_little_do_not_move_the_heading() -> None:
    both = TwoHeadings(0.3)
    both.follow(0.6)
    assert both.leading_rad == 0.3


def test_a_small_gain_counts_in_the_end_alone() -> None:
    assert changes([(0.1, 0.095)] * (SETTLING_FRAMES - 1)) == []
    assert changes([(0.1, 0.095)] * SETTLING_FRAMES) == [SETTLING_FRAMES - 1]
    assert changes([(0.1, 0.0999)] * SETTLING_FRAMES) == [SETTLING_FRAMES - 1]
    assert changes([(0.1, 0.1)] * SETTLING_FRAMES) == []


def test_frames_that_were_searched_for_the_first_heading_do_not_count() -> None:
    early = [(0.1, 0.5)] * SIZED_FROM
    later = [(0.1, 0.095)] * (SETTLING_FRAMES - SIZED_FROM)
    assert changes(early + later) == [SETTLING_FRAMES - 1]


def test_poses_that_improved_count_as_they_are_now() -> None:
    before = SETTLING_FRAMES - COMPARED
    assert changes([(0.109, 0.1)] * before + [(0.1, 0.1)] * COMPARED) == []


def test_a_start_goes_on_while_the_latest_frame_contradicts_the_mean() -> None:
    before = [0.11] * (SETTLING_FRAMES - COMPARED)
    improving = [0.104, 0.091, 0.084, 0.077]
    both = TwoHeadings(0.0)
    for number, cost in enumerate(before + improving):
        assert not both.over
        both.note(number * FRAME_NS, (fit(0.085), fit(cost)))
        assert not both.change()
    assert not both.over
    # One frame more, and the mean says the same as the latest frame.
    both.note(SETTLING_FRAMES * FRAME_NS, (fit(0.085), fit(0.077)))
    assert both.over and both.change() and both.over


def test_a_start_does_not_go_on_for_ever() -> None:
    # From the eighth frame on the latest one always contradicts the mean of four.
    gains = [0.0, 0.0, 0.0, 0.0, 0.0, 6.0, 1.0, -2.0, -3.0, 1.0, 1.0, 0.5]
    assert len(gains) == MOST_FRAMES
    both = TwoHeadings(0.0)
    for number, gain in enumerate(gains):
        assert not both.over
        both.note(number * FRAME_NS, (fit(0.1), fit(0.1 - 0.001 * gain)))
    assert both.over


def test_it_changes_back_if_later_frames_contradict() -> None:
    """In a single frame the evidence may mislead."""
    misled, rest = SIZED_FROM + 1, SETTLING_FRAMES - SIZED_FROM - 1
    assert changes([(0.115, 0.1)] * misled + [(0.1, 0.115)] * rest) == [SIZED_FROM, 6]
    assert changes([(0.115, 0.1)] * misled + [(0.1, 0.101)] * rest) == [SIZED_FROM, 7]


def test_a_heading_without_a_pose_leads_no_longer() -> None:
    assert changes([(0.1, 0.2)] * 4 + [(None, 0.2)]) == [4]
    assert changes([(0.1, None)] * SETTLING_FRAMES) == []


@pytest.mark.parametrize(
    ("heading_rad", "walks_m", "expected"),
    [
        pytest.param(0.0, 0.03, [], id="forwards"),
        pytest.param(math.pi, 0.03, [4], id="backwards"),
        pytest.param(0.5 * math.pi, 0.03, [], id="sideways"),
        pytest.param(math.pi, 0.005, [], id="slowly"),
    ],
)
def test_a_person_walks_forwards(heading_rad: float, walks_m: float, expected: list[int]) -> None:
    # Beyond 5 cm; a walk is worth 0.02, the smallest gain before the end 0.01.
    assert changes([(0.1, 0.1)] * (SETTLING_FRAMES - 1), heading_rad, walks_m) == expected


def test_poses_of_the_leading_heading() -> None:
    both = TwoHeadings(1.0)
    first, opposite = fit(0.1), fit(0.2)
    both.note(0, (first, opposite))
    both.note(1, (None, opposite))
    assert both.leading_fits == [first] and len(both) == 2


@pytest.mark.parametrize("gap_at", [1, 2, 3])
def test_a_frame_after_a_gap_early_on_does_not_count(gap_at) -> None:
    """In that frame the leading heading is far off; from then on it is the better one."""
    both = TwoHeadings(0.0)
    for number in range(SETTLING_FRAMES):
        if number == gap_at:
            both.restart()
        costs = (0.3, 0.1) if number == gap_at else (0.1, 0.105)
        both.note(number * FRAME_NS, (fit(costs[0]), fit(costs[1])))
        # From the fourth frame on a restart changes nothing; that frame counts until the last one.
        assert both.change() == (gap_at > SIZED_FROM and number in (gap_at, SETTLING_FRAMES - 1))
    assert both.over
