"""What the JSON file beside a marker file says about its rows."""

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from markerless_tracker.body import MARKER_NAMES, load_body
from markerless_tracker.datasets import MarkerTrack, read_trc
from markerless_tracker.errors import DatasetError
from markerless_tracker.records import Confidence, TrackResult, TrackState
from markerless_tracker.results.result import ResultWriter
from markerless_tracker.results.stored import stored_frames
from markerless_tracker.tracking import TrackerConfig

FRAME_NS = 16_666_667
TRACK = MarkerTrack(("Head",), np.array([0, FRAME_NS]), np.ones((2, 1, 3)))


def result(stamp_ns: int, state: TrackState, sd_m: float | None, *, pose=True) -> TrackResult:
    sd = np.full((15, 3), sd_m or 0.0)
    sure = None if sd_m is None else Confidence(np.zeros(31), sd, np.zeros((6, 6)))
    return TrackResult(
        stamp_ns=stamp_ns,
        state=state,
        pose=np.zeros(31) if pose else None,
        markers_m=np.ones((15, 3)) if pose else None,
        fitness=1.0,
        iou={},
        evaluations=1,
        confidence=sure,
    )


def writer(name: Path) -> ResultWriter:
    config = TrackerConfig.from_mapping({"preset": "paper"})
    return ResultWriter(name, load_body("balan31", 1.7), config, fps=60.0)


@pytest.mark.parametrize("ended", [True, False])
def test_deviations_and_lost_frames_of_a_result(tmp_path: Path, ended) -> None:
    written = writer(tmp_path / "walk")
    written.add(result(0, TrackState.SEARCHING, None, pose=False))
    written.add(result(FRAME_NS, TrackState.TRACKING, 0.01))
    written.add(result(2 * FRAME_NS, TrackState.LOST, 0.02))
    written.add(result(3 * FRAME_NS, TrackState.TRACKING, None))
    # Time was set back.
    written.add(result(FRAME_NS, TrackState.LOST, 0.03))
    written.add(result(2 * FRAME_NS, TrackState.TRACKING, 0.04))
    if ended:
        written.close()
    assert (tmp_path / "walk.jsonl").exists() != ended
    first = stored_frames(written.trc_path, read_trc(written.trc_path))
    assert first.track.names == MARKER_NAMES
    assert first.track.tracked.tolist() == [False, True, False, True]
    np.testing.assert_array_equal(first.markers_sd_mm[:, 3, 1], [np.nan, 10.0, 20.0, np.nan])
    again = tmp_path / "walk.2.trc"
    second = stored_frames(again, read_trc(again))
    assert second.track.tracked.tolist() == [False, True]
    np.testing.assert_array_equal(second.markers_sd_mm[:, 0, 0], [30.0, 40.0])
    if not ended:
        written.close()


def test_nothing_beside_the_marker_file(tmp_path: Path) -> None:
    for name in ("walk.trc", "walk.2.trc", "walk", "..2.trc"):
        assert stored_frames(tmp_path / name, TRACK) is None


def test_rows_and_markers_that_only_one_file_has(tmp_path: Path) -> None:
    deviations = {"Head": [1.0, None, 3.0], "Nose": [1, 1, 1]}
    frames = [
        {"stamp_ns": 7, "state": "LOST", "markers_sd_mm": deviations},
        {"stamp_ns": FRAME_NS, "markers_sd_mm": deviations},
    ]
    (tmp_path / "walk.json").write_text(json.dumps({"frames": frames}))
    found = stored_frames(tmp_path / "walk.trc", TRACK)
    np.testing.assert_array_equal(found.track.positions_m, TRACK.positions_m)
    np.testing.assert_array_equal(found.markers_sd_mm[:, 0], [[np.nan] * 3, [1.0, np.nan, 3.0]])


anything = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=3),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=3), inner),
    max_leaves=6,
)
frame_like = st.fixed_dictionaries(
    {"stamp_ns": st.just(0) | anything},
    optional={
        "state": anything,
        "segment": anything,
        "markers_sd_mm": anything | st.fixed_dictionaries({"Head": anything}),
    },
)


@given(st.lists(frame_like | anything, max_size=3) | anything)
def test_a_hostile_file_is_read_or_named(tmp_path_factory, frames) -> None:
    folder = tmp_path_factory.mktemp("hostile")
    (folder / "walk.json").write_text(json.dumps({"frames": frames}))
    try:
        found = stored_frames(folder / "walk.trc", TRACK)
    except DatasetError as error:
        assert "walk.json" in str(error)
    else:
        assert found.markers_sd_mm.shape == (2, 1, 3)
        assert not (found.markers_sd_mm < 0).any()
