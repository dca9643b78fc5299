"""A person hardly in view is not tracked yet."""

import numpy as np
import pytest

from markerless_tracker.body import load_body
from markerless_tracker.camera import CameraModel, CameraRig
from markerless_tracker.records import Observation, TrackState
from markerless_tracker.synthesis import SyntheticScene
from markerless_tracker.synthesis.rig import ring_rig
from markerless_tracker.tracking import TrackerConfig, build_tracker
from markerless_tracker.tracking.start.in_view import (
    GAP_NS,
    PATIENCE_NS,
    InViewGate,
    fraction_in_view,
)


@pytest.fixture(scope="module")
def body():
    return load_body("person31", 1.72)


def standing(body, x_m: float):
    pose = body.neutral.copy()
    pose[body.index("pelvis_tx")] = x_m
    pose[body.index("pelvis_tz")] = 0.95
    return pose


def test_in_the_middle_everything_is_seen(body) -> None:
    assert fraction_in_view(body, standing(body, 0.0), ring_rig(4), 4) == 1.0


def test_two_cameras_must_see_it(body) -> None:
    rig = ring_rig(4)
    assert fraction_in_view(body, standing(body, 0.0), rig.cameras[:1], 2) == 0.0
    assert fraction_in_view(body, standing(body, 0.0), rig.cameras[:2], 2) == 1.0


def test_the_share_falls_towards_the_edge(body) -> None:
    places = np.linspace(0.0, 4.0, 81)
    shares = [fraction_in_view(body, standing(body, x), ring_rig(3), 2) for x in places]
    assert shares[0] == 1.0 and shares[-1] == 0.0
    assert any(0.2 < share < 0.8 for share in shares)


def test_a_third_camera_is_waited_for_a_while(body) -> None:
    rig, pose = ring_rig(4), standing(body, 0.0)
    aside = standing(body, 2.6)
    assert (
        fraction_in_view(body, aside, rig, 2) == 1.0 > 0.5 > fraction_in_view(body, aside, rig, 3)
    )
    assert InViewGate().enough(body, pose, rig, 0)
    # Others do not look: two are all there are.
    assert InViewGate().enough(body, pose, rig.cameras[:2], 0)
    gate = InViewGate()
    for stamp_ns in range(5, 5 + PATIENCE_NS, GAP_NS):
        assert not gate.enough(body, aside, rig, stamp_ns)
    assert gate.enough(body, aside, rig, 5 + PATIENCE_NS)
    gate.reset()
    assert not gate.enough(body, aside, rig, 6 + PATIENCE_NS)
    assert not gate.enough(body, standing(body, 9.0), rig, 9 * PATIENCE_NS)


@pytest.mark.parametrize("fps", [1.0, 1.9, 2.0, 30.0])
def test_a_third_camera_is_waited_for_as_long_at_any_rate(body, fps: float) -> None:
    gate, rig, aside = InViewGate(), ring_rig(4), standing(body, 2.6)
    frame = next(k for k in range(100) if gate.enough(body, aside, rig, round(k / fps * 1e9)))
    assert PATIENCE_NS <= frame / fps * 1e9 + 1 < PATIENCE_NS + 1e9 / fps + 1


def test_the_next_person_is_waited_for_as_the_first_was(body) -> None:
    """The first leaves without an empty frame in between: things stay in view."""
    rig, away, aside = ring_rig(4), standing(body, 9.0), standing(body, 2.6)
    gate = InViewGate()
    for stamp_ns in range(0, PATIENCE_NS, GAP_NS):
        assert not gate.enough(body, aside, rig, stamp_ns)
        assert not gate.enough(body, away, rig, stamp_ns)
    assert gate.enough(body, aside, rig, PATIENCE_NS)
    later = 10 * PATIENCE_NS
    assert not gate.enough(body, aside, rig, later)
    for stamp_ns in range(later, later + PATIENCE_NS, GAP_NS):
        assert not gate.enough(body, aside, rig, stamp_ns)
    assert gate.enough(body, aside, rig, later + PATIENCE_NS)


def test_a_person_is_waited_for_however_long_a_thing_has_been_in_view(body) -> None:
    rig, thing, person = ring_rig(4), standing(body, 2.6), standing(body, -2.6)
    assert (
        fraction_in_view(body, person, rig, 2) == 1.0 > 0.5 > fraction_in_view(body, person, rig, 3)
    )
    gate = InViewGate()
    for stamp_ns in range(0, PATIENCE_NS + 1, GAP_NS):
        gate.enough(body, thing, rig, stamp_ns)
    for stamp_ns in range(PATIENCE_NS, 2 * PATIENCE_NS, GAP_NS):
        assert gate.enough(body, thing, rig, stamp_ns)
        assert not gate.enough(body, person, rig, stamp_ns)
    assert gate.enough(body, person, rig, 2 * PATIENCE_NS)


def test_a_person_who_walks_is_the_same_person(body) -> None:
    rig, gate = ring_rig(4), InViewGate()
    steps = range(0, PATIENCE_NS, GAP_NS // 4)
    for stamp_ns in steps:
        assert not gate.enough(
            body, standing(body, 2.6 + 0.2 * (stamp_ns / PATIENCE_NS)), rig, stamp_ns
        )
    assert gate.enough(body, standing(body, 2.6), rig, PATIENCE_NS)


def test_a_recording_that_begins_anew_is_another_visit(body) -> None:
    rig, aside = ring_rig(4), standing(body, 2.6)
    gate = InViewGate()
    for stamp_ns in range(0, PATIENCE_NS + 1, GAP_NS):
        gate.enough(body, aside, rig, stamp_ns)
    assert not gate.enough(body, aside, rig, PATIENCE_NS - 1)


def test_nobody_is_started_from_an_outline_and_a_hand() -> None:
    """One camera sees the whole person, the other's frame ends where the person begins."""
    scene = SyntheticScene(body="person31", motion="stand", size_px=(200, 152), seed=2)
    masks = scene.frame(0)[1]
    whole, beside = (scene.rig[name] for name in ("cam01", "cam02"))
    columns = np.flatnonzero(masks["cam02"].any(axis=0))

    def first_state(width: int) -> TrackState:
        narrow = CameraModel(
            "cam02", (width, 152), beside.matrix, beside.distortion, beside.T_cam_world
        )
        seen = {"cam01": masks["cam01"], "cam02": np.ascontiguousarray(masks["cam02"][:, :width])}
        rig = CameraRig((whole, narrow))
        tracker = build_tracker(rig, TrackerConfig(threads=1), stature=1.72).tracker
        views = {
            name: Observation.from_mask(name, 0, mask, np.zeros(mask.shape, np.uint8))
            for name, mask in seen.items()
        }
        return tracker.step(views, 0).state

    assert first_state(200) is TrackState.TRACKING
    assert first_state(int(columns[0] + 0.3 * columns.size)) is TrackState.SEARCHING
