"""Which searches the first frame of a start gets."""

import numpy as np
import pytest

from markerless_tracker.body import markers
from markerless_tracker.records import Observation
from markerless_tracker.synthesis import SyntheticScene
from markerless_tracker.tracking import TrackerConfig, build_tracker
from markerless_tracker.tracking.candidates.population import FramePopulation
from markerless_tracker.tracking.start.starter import Starter

STARTER = "markerless_tracker.tracking.start.starter"


@pytest.fixture(scope="module")
def first(take_frames):
    """The scene of a walking person, and the first frame's stamp and observations."""
    scene = SyntheticScene(body="person31", motion="walk", size_px=(328, 245), seed=2)
    ((stamp, seen, _),) = take_frames(scene, [0])
    return scene, stamp, seen


def tracker_of(scene, **subject):
    return build_tracker(scene.rig, TrackerConfig(threads=1), **subject).tracker


@pytest.fixture
def searches(monkeypatch) -> list[int]:
    """Stamps (ns) of the frames searched for a person, one for each search."""
    stamps, once = [], Starter._search_once

    def counted(self, hull, observations, stamp_ns):
        stamps.append(stamp_ns)
        return once(self, hull, observations, stamp_ns)

    monkeypatch.setattr(Starter, "_search_once", counted)
    return stamps


def test_silhouettes_with_holes_alone_are_searched_for_a_usual_posture(first, searches) -> None:
    scene, stamp, seen = first
    torn = {}
    for name, view in seen.items():
        mask = view.mask.copy()
        rows = np.flatnonzero(mask.any(axis=1))
        mask[rows[0] : rows[-1] : 12] = mask[rows[0] + 1 : rows[-1] : 12] = False
        mask[rows[len(rows) // 3] : rows[len(rows) // 2]] = False
        torn[name] = Observation.from_mask(name, 0, mask, np.zeros(mask.shape, np.uint8))
    for views, usual in ((seen, False), (torn, True)):
        tracker = tracker_of(scene, stature=1.72)
        searches.clear()
        assert tracker.step(views, stamp).pose is not None
        assert tracker._start._charges_postures is usual
        # The usual posture is searched in the next frame: nobody waits for it.
        assert len(searches) == 1


def test_what_is_no_person_is_searched_for_a_usual_posture_at_once(
    first, searches, monkeypatch
) -> None:
    scene, stamp, seen = first
    monkeypatch.setattr(f"{STARTER}.LEAST_FIT", 1.0)
    tracker = tracker_of(scene, stature=1.72)
    assert tracker.step(seen, stamp).pose is None
    assert searches == [stamp, stamp]


@pytest.mark.parametrize("statures_m", [(1.45, 1.72), (1.72, 1.45)])
def test_of_two_statures_only_that_of_the_better_guess_is_refined(
    first, monkeypatch, statures_m
) -> None:
    scene, stamp, seen = first
    heights_m, initialised = [], FramePopulation.initialised

    def noted(frame, guesses):
        body = frame._searcher.body
        heights_m.append(markers(body, body.neutral)[2, 2])
        return initialised(frame, guesses)

    monkeypatch.setattr(FramePopulation, "initialised", noted)
    monkeypatch.setattr(f"{STARTER}.first_statures_m", lambda hull: statures_m)
    assert tracker_of(scene).step(seen, stamp).pose is not None
    (height_m,) = heights_m
    assert height_m == pytest.approx(markers(scene.body, scene.body.neutral)[2, 2], abs=0.08)
