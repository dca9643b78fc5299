"""An object that is no person is searched ever more rarely, and hides no person."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from markerless_tracker.camera import project_camera
from markerless_tracker.records import Observation, TrackState
from markerless_tracker.synthesis import SyntheticScene
from markerless_tracker.tracking import TrackerConfig, build_tracker
from markerless_tracker.tracking.evidence.grid import FINE_M
from markerless_tracker.tracking.evidence.hull import Hull
from markerless_tracker.tracking.start import starter
from markerless_tracker.tracking.start.rejections import (
    FIRST_WAIT,
    FORGOTTEN_NS,
    LONGEST_WAIT_NS,
    MOVED_M,
    Rejections,
)
from markerless_tracker.tracking.start.starter import Starter

FRAME_NS = 16_666_667
FRAMES = 30


def block(middle, cells=(10, 10, 50)) -> Hull:
    points = FINE_M * (np.argwhere(np.ones(cells, dtype=np.bool_)) + 0.5)
    points = points - points.mean(axis=0) + middle
    return Hull(points, points, points)


def searched(rejections, hull, frames, first=0, frame_ns=FRAME_NS):
    """Frames in which a hull that is always rejected is searched."""
    taken = []
    for frame in range(first, first + frames):
        rejections.begin_frame(frame * frame_ns)
        if not rejections.waits(hull):
            rejections.note(hull)
            taken.append(frame)
    return taken


def test_the_waits_double_up_to_a_second() -> None:
    taken = searched(Rejections(), block((0.0, 0.0, 0.75)), 600)
    gaps = np.diff(taken)
    waits = FIRST_WAIT * 2 ** np.arange(4) + 1
    np.testing.assert_array_equal(gaps[:4], waits)
    assert gaps[-1] * FRAME_NS == pytest.approx(LONGEST_WAIT_NS, abs=FRAME_NS)
    assert gaps.max() * FRAME_NS <= LONGEST_WAIT_NS + FRAME_NS


def test_slow_cameras_do_not_wait_for_frames() -> None:
    taken = searched(Rejections(), block((0.0, 0.0, 0.75)), 5, frame_ns=LONGEST_WAIT_NS)
    assert taken == [0, 1, 2, 3, 4]


@pytest.mark.parametrize(
    ("other", "waits"),
    [
        (block((0.1, 0.0, 0.75)), True),
        (block((MOVED_M + 0.05, 0.0, 0.75)), False),
        (block((0.0, 0.0, 0.75), (11, 10, 50)), True),
        (block((0.0, 0.0, 0.75), (14, 10, 50)), False),
        (block((0.0, 0.0, 0.75), (6, 10, 50)), False),
        (block((0.0, 0.0, 0.75), (7, 10, 72)), False),
    ],
    ids=["the same", "moved", "a little larger", "larger", "smaller", "taller"],
)
def test_only_the_same_hull_waits(other, waits) -> None:
    rejections = Rejections()
    searched(rejections, block((0.0, 0.0, 0.75)), 20)
    rejections.begin_frame(20 * FRAME_NS)
    assert rejections.waits(other) is waits


def test_hulls_wait_each_for_itself() -> None:
    rejections = Rejections()
    one, other = block((0.0, 0.0, 0.75)), block((2.0, 0.0, 0.75))
    searched(rejections, one, 20)
    rejections.begin_frame(20 * FRAME_NS)
    assert not rejections.waits(other)
    rejections.note(other)
    rejections.begin_frame(21 * FRAME_NS)
    assert rejections.waits(one) and rejections.waits(other)


def test_what_was_long_not_seen_is_forgotten_as_is_all_when_stamps_are_set_back() -> None:
    hull = block((0.0, 0.0, 0.75))
    rejections = Rejections()
    searched(rejections, hull, 30)
    later = 1 + (30 * FRAME_NS + FORGOTTEN_NS) // FRAME_NS
    assert searched(rejections, hull, FIRST_WAIT + 2, first=later) == [
        later, later + FIRST_WAIT + 1,
    ]  # fmt: skip
    rejections.begin_frame(0)
    assert not rejections.waits(hull)


def with_box(scene, masks, stamp_ns):
    """Observations of the masks, and of an upright box beside them."""
    corners = np.stack(
        np.meshgrid([0.9, 1.6], [0.9, 1.6], [0.0, 1.3], indexing="ij"), axis=-1
    ).reshape(-1, 3)
    seen = {}
    for camera in scene.rig:
        mask = np.zeros(camera.size_px[::-1], np.uint8)
        outline = cv2.convexHull(np.round(project_camera(corners, camera)).astype(np.int32))
        cv2.fillConvexPoly(mask, outline, 1)
        if masks is not None:
            mask |= np.asarray(masks[camera.name] > 0, np.uint8)
        seen[camera.name] = Observation.from_mask(
            camera.name, stamp_ns, mask, np.zeros(mask.shape, np.uint8)
        )
    return seen


def test_a_box_is_searched_a_few_times_and_a_person_at_once(monkeypatch) -> None:
    scene = SyntheticScene(body="person31", motion="stand", size_px=(256, 192), seed=2)
    tracker = build_tracker(scene.rig, TrackerConfig(threads=1), stature=1.72).tracker
    searches = []
    search = Starter._search

    def counted(self, *args):
        searches.append(args)
        return search(self, *args)

    monkeypatch.setattr(Starter, "_search", counted)
    # A generic body covers so large a box better than the least that is a person.
    monkeypatch.setattr(starter, "LEAST_FIT", 0.78)
    box = with_box(scene, None, 0)
    for frame in range(FRAMES):
        views = {name: replace(seen, stamp_ns=frame * FRAME_NS) for name, seen in box.items()}
        assert tracker.step(views, frame * FRAME_NS).state is TrackState.SEARCHING
    assert 1 <= len(searches) <= 5
    stamp_ns = FRAMES * FRAME_NS
    result = tracker.step(with_box(scene, scene.frame(0)[1], stamp_ns), stamp_ns)
    assert result.state is TrackState.TRACKING
    error_m = np.linalg.norm(result.markers_m - scene.markers(0), axis=1).mean()
    assert error_m < 0.12
