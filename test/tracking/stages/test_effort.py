"""Tests for `markerless_tracker.tracking.stages.effort`."""

import numpy as np
import pytest

from markerless_tracker.body import load_body
from markerless_tracker.errors import ConfigError
from markerless_tracker.tracking import TrackerConfig
from markerless_tracker.tracking.stages.effort import NEAR, VERY_DENSE_S, WORSE, Effort


def _settled() -> Effort:
    effort = Effort(needed_only=True)
    for _ in range(50):
        effort.begin(1.0, doubt=False)
        effort.tracked(0.05)
    effort.begin(1.0, doubt=False)
    return effort


def _wants_swarms(effort: Effort, cost: float) -> bool:
    effort.judge(cost)
    return effort.wants_swarms


def test_the_first_frame_is_searched_by_swarms() -> None:
    effort = Effort(needed_only=True)
    effort.begin(1.0, doubt=False)
    assert _wants_swarms(effort, 0.01)


def test_a_frame_as_usual_needs_no_swarms() -> None:
    assert not _wants_swarms(_settled(), 0.05 + 0.9 * WORSE)


def test_a_frame_worse_than_usual_needs_swarms() -> None:
    assert _wants_swarms(_settled(), 0.05 + 1.1 * WORSE)


def test_a_limb_in_doubt_needs_swarms() -> None:
    effort = _settled()
    effort.begin(1.0, doubt=True)
    assert _wants_swarms(effort, 0.05)


def test_all_frames_are_searched_if_not_only_the_needed_ones_are() -> None:
    effort = Effort(needed_only=False)
    for _ in range(5):
        effort.begin(1.0, doubt=False)
        assert _wants_swarms(effort, 0.05)
        effort.tracked(0.05)


def test_frames_in_which_the_person_is_lost_are_not_usual() -> None:
    effort, body = _settled(), load_body("person31", 1.75)
    for _ in range(30):
        effort.begin(1.0, doubt=False)
        lost = Recorder(0.0, 0.5)
        effort.search(lost, body, TrackerConfig(), body.neutral, body.sigma)  # type: ignore[arg-type]
    effort.begin(1.0, doubt=False)
    assert _wants_swarms(effort, 0.05 + 1.1 * WORSE)


@pytest.mark.parametrize(
    "since_s, again", [(0.9 * VERY_DENSE_S, False), (1.1 * VERY_DENSE_S, True)]
)
def test_what_all_searches_left_is_usual_for_the_frames_that_follow_soon(since_s, again) -> None:
    effort = _settled()
    for wants in (True, again):
        effort.begin(1.0, doubt=False, since_s=since_s)
        assert _wants_swarms(effort, 0.05 + 1.5 * WORSE) == wants
        effort.tracked(0.05 + 1.5 * WORSE)


def test_what_one_searched_frame_left_is_not_usual_later() -> None:
    effort, cost = _settled(), 0.05 + 1.5 * WORSE
    for since_s, wants in ((0.02, True), (0.033, True), (0.02, False), (0.033, True)):
        effort.begin(1.0, doubt=False, since_s=since_s)
        assert _wants_swarms(effort, cost) == wants
        if wants and since_s == 0.02:
            effort.tracked(cost)


def test_reset_forgets_the_usual_cost() -> None:
    effort = _settled()
    effort.reset()
    effort.begin(1.0, doubt=False)
    assert _wants_swarms(effort, 0.05)


@pytest.mark.parametrize(("fraction", "granted"), [(1.0, 100), (0.5, 50), (0.1, 10), (0.0, 0)])
def test_effort_is_the_fraction_of_frames_that_are_searched(fraction: float, granted: int) -> None:
    effort = Effort(needed_only=False)
    effort.begin(1.0, doubt=False)
    effort.tracked(0.05)
    count = 0
    swarms = 0
    for _ in range(100):
        effort.begin(fraction, doubt=False)
        count += effort.granted
        swarms += _wants_swarms(effort, 0.05)
        assert effort.granted or not effort.for_limbs
    assert count == granted
    # With less than everything, every other search is left to the limbs.
    assert swarms == (granted if fraction == 1.0 else granted // 2)


@pytest.mark.parametrize("fraction", [-0.1, 1.1, float("nan")])
def test_an_effort_that_is_no_fraction_is_refused(fraction: float) -> None:
    with pytest.raises(ConfigError, match="effort is .*expected 0 to 1"):
        Effort(needed_only=True).begin(fraction, doubt=False)


class Recorder:
    """Stands for a frame's search: notes the stages; a refinement moves the pose by a step."""

    def __init__(self, step: float, cost: float) -> None:
        self.pose, self.cost = np.zeros(31), cost
        self.step = step
        self.names: list[str] = []

    def run(self, stages) -> None:
        self.names += [stage.name for stage in stages]
        self.pose = self.pose + self.step


@pytest.mark.parametrize(
    ("step", "cost", "polished"),
    [(0.9 * NEAR, 0.05, False), (1.1 * NEAR, 0.05, True), (0.0, 0.05 + 2.0 * WORSE, True)],
    ids=["near its end", "far", "with swarms"],
)
def test_a_pose_is_refined_again_if_it_moved_or_swarms_searched(step, cost, polished) -> None:
    body = load_body("person31", 1.75)
    search = Recorder(step, cost)
    _settled().search(search, body, TrackerConfig(), body.neutral, body.sigma)  # type: ignore[arg-type]
    assert search.names[0] == "align"
    assert (search.names[-1] == "polish") is polished
    assert (len(search.names) > 2) is (cost > 0.05 + WORSE)


def test_frames_far_apart_are_all_searched() -> None:
    effort = _settled()
    granted = []
    for since_s in (0.01, 0.1, 0.12, 0.12, 0.01):
        effort.begin(0.4, doubt=False, since_s=since_s)
        granted.append(effort.granted)
    assert granted == [False, False, True, True, False]
    for since_s in (0.1, 0.1):
        effort.begin(0.4, doubt=True, since_s=since_s)
        assert effort.granted and not effort.reduced
    effort.begin(0.0, doubt=True, since_s=0.1)
    assert not effort.granted


def _searches(effort: Effort, cost: float) -> tuple[bool, bool]:
    """Whether swarms search a frame of a cost, and whether the limbs' searches may."""
    body, search = load_body("person31", 1.75), Recorder(0.0, cost)
    effort.search(search, body, TrackerConfig(), body.neutral, body.sigma)  # type: ignore[arg-type]
    return len(search.names) > 2, effort.for_limbs


def test_who_is_late_searches_by_swarms_or_by_limbs_in_turn() -> None:
    found = []
    for fraction in (1.0, 0.5):
        effort = _settled()
        effort.configure(TrackerConfig.from_mapping({"refine.swarms": "always"}))
        for _ in range(6):
            effort.begin(fraction, doubt=False, since_s=0.2)
            found.append(_searches(effort, 0.05))
    assert found[:6] == [(True, True)] * 6
    assert sorted(found[6:8]) == [(False, True), (True, False)]
    assert found[6:8] == found[8:10] == found[10:12]


def test_a_badly_explained_frame_gets_all_searches_even_of_who_is_late() -> None:
    effort = _settled()
    for _ in range(6):
        effort.begin(0.1, doubt=False)
        assert not effort.granted
        assert _searches(effort, 0.05) == (False, False)
        effort.begin(0.1, doubt=False)
        assert _searches(effort, 0.05 + 2.0 * WORSE) == (True, True)
        assert effort.badly and effort.late and not effort.reduced
        # With this frame the others have their turn again.
        effort.tracked(0.05)
    effort.begin(0.0, doubt=False)
    assert _searches(effort, 0.05 + 2.0 * WORSE) == (False, False)


def test_who_has_time_for_all_searches_is_not_late() -> None:
    effort = _settled()
    for cost in (0.05, 0.05 + 2.0 * WORSE):
        effort.begin(1.0, doubt=False)
        _searches(effort, cost)
        assert effort.badly is (cost > 0.05 + WORSE) and not effort.late
