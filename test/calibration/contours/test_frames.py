"""Choice of the frames that a calibration is refined with."""

import numpy as np
import pytest

from markerless_tracker.calibration.contours.frames import (
    MOST,
    FrameChoice,
    SeenFrame,
    extent_m,
    independence,
)
from markerless_tracker.geometry import FloatArray
from markerless_tracker.records import Observation, TrackResult, TrackState

MASK = np.ones((8, 8), dtype=bool)
NOTHING = np.zeros_like(MASK)


def result(index: int, at_m: float, state: TrackState = TrackState.TRACKING, views: int = 2):
    seen = {
        name: Observation.from_mask(
            name, index, MASK if i < views else NOTHING, np.full(MASK.shape, 9, np.uint8)
        )
        for i, name in enumerate(("cam01", "cam02"))
    }
    return TrackResult(index, state, np.zeros(6), markers(at_m), 1.8, {}, 0, observations=seen)


def markers(at_m: float) -> FloatArray:
    return np.tile([at_m, 0.0, 1.0], (15, 1))


def frame(at_m: float) -> SeenFrame:
    return SeenFrame(0, np.zeros(6), markers(at_m), {})


@pytest.mark.parametrize("count", [5, 40, 1000])
def test_few_frames_cover_the_whole_path(count: int) -> None:
    choice = FrameChoice()
    for index in range(count):
        choice.add(result(index, 2.0 * index / (count - 1)))
    chosen = choice.chosen()
    assert len(chosen) == min(count, MOST)
    assert len({one.stamp_ns for one in chosen}) == len(chosen)
    places = np.sort([one.markers_m[0, 0] for one in chosen])
    assert np.ptp(places) > 1.9 and np.diff(places).max() < 0.6
    assert not any(o.edges.any() for one in chosen for o in one.observations.values())


def test_frames_without_a_pose_or_with_one_view_are_passed_over() -> None:
    choice = FrameChoice()
    choice.add(result(0, 0.0, TrackState.LOST))
    choice.add(result(1, 0.0, views=1))
    choice.add(TrackResult(2, TrackState.SEARCHING, None, None, float("nan"), {}, 0))
    assert choice.chosen() == []


def test_equal_frames_count_as_one_and_distant_ones_as_many() -> None:
    assert independence([frame(0.5)] * 7).sum() == pytest.approx(1.0)
    assert independence([frame(2.0 * i) for i in range(7)]).sum() == pytest.approx(7.0)
    mixed = independence([frame(0.0), frame(0.0), frame(3.0)])
    np.testing.assert_allclose(mixed, [0.5, 0.5, 1.0])


def test_the_extent_of_the_motion() -> None:
    np.testing.assert_allclose(extent_m([frame(0.2), frame(1.5), frame(0.7)]), [1.3, 0.0, 0.0])
