"""Which searches a start leaves out if sets come faster than they are searched."""

import pytest

from markerless_tracker.synthesis import SyntheticScene
from markerless_tracker.tracking import TrackerConfig, build_tracker
from markerless_tracker.tracking.start.two_headings import SETTLING_FRAMES

STARTER = "markerless_tracker.tracking.start.starter"


@pytest.fixture(scope="module")
def walk(take_frames):
    """Stamps, observations and true markers of a walking person."""
    scene = SyntheticScene(body="person31", motion="walk", size_px=(328, 245), seed=2)
    return scene, take_frames(scene, range(SETTLING_FRAMES + 1))


@pytest.mark.parametrize(
    "sure, effort, searches",
    [
        (True, 1.0, ["last"]),
        (True, 0.5, []),
        (False, 1.0, ["second", "last"]),
        (False, 0.5, ["last"]),
    ],
)
def test_a_late_start_is_searched_once_more_in_doubt_only(
    walk, monkeypatch, sure, effort, searches
) -> None:
    scene, taken = walk
    done: list[str] = []
    monkeypatch.setattr(f"{STARTER}._is_sure", lambda _: sure)
    monkeypatch.setattr(
        f"{STARTER}.Starter._second_search",
        lambda _, frame, population, seen: done.append("second") or population,
    )
    monkeypatch.setattr(
        f"{STARTER}.searched_again", lambda _, pose, *rest: done.append("last") or (pose, ("said",))
    )
    tracker = build_tracker(scene.rig, TrackerConfig(threads=1), stature=1.72).tracker
    results = [tracker.step(seen, stamp, effort) for stamp, seen, _ in taken]
    assert done == searches
    # A start has as many frames, whatever the effort: a shorter one would begin a wrong track.
    assert [result.settling for result in results].index(False) == SETTLING_FRAMES - 1
    assert ("said" in results[SETTLING_FRAMES - 1].warnings) is ("last" in searches)
