"""The end of a start: the body is fitted if it may be, and its pose stays near the last one."""

import numpy as np
import pytest

from markerless_tracker.body import load_body, markers
from markerless_tracker.synthesis import SyntheticScene
from markerless_tracker.tracking import TrackerConfig
from markerless_tracker.tracking.search import Searcher, make_searcher
from markerless_tracker.tracking.start.final_search import searched_again
from markerless_tracker.tracking.start.starter import Starter
from markerless_tracker.tracking.start.two_headings import MOST_FRAMES

BODY = load_body("person31", 1.75)


@pytest.fixture
def last_searches(monkeypatch) -> list[Searcher]:
    """The searchers of the last frame's search, one for each search."""
    used: list[Searcher] = []

    def noted(searcher, *frame):
        used.append(searcher)
        return searched_again(searcher, *frame)

    monkeypatch.setattr("markerless_tracker.tracking.start.starter.searched_again", noted)
    return used


@pytest.mark.parametrize("fit_shape", [True, False])
def test_a_start_ends_with_the_fit_of_the_body_and_a_search_with_it(
    take_frames, last_searches, fit_shape
) -> None:
    scene = SyntheticScene(body="person31", motion="stand", size_px=(328, 245), seed=2)
    ((_, seen, _),) = take_frames(scene, [0])
    searching = dict(rig=scene.rig, config=TrackerConfig(threads=1), threads=1)
    starter = Starter(
        scene.rig, BODY, lambda body: make_searcher(body, **searching),
        lambda observed, *_: (dict(observed), ()), fit_shape=fit_shape,
    )  # fmt: skip
    for number in range(MOST_FRAMES):
        found = starter.step(seen, number * 16_000_000)
        assert found is not None
        if found.settled:
            break
        before = found.pose
    assert found.settled
    sections = found.searcher.body.cone_shape
    assert np.allclose(sections, BODY.cone_shape) is not fit_shape
    assert last_searches == ([found.searcher] if fit_shape else [])
    off_m = np.linalg.norm(markers(BODY, found.pose) - markers(BODY, before), axis=1)
    assert off_m.max() < 0.02
    assert found.observations.keys() == seen.keys()
