"""A camera that disagrees with the others."""

from dataclasses import replace

import numpy as np
import pytest

from markerless_tracker.body import markers
from markerless_tracker.camera import CameraRig
from markerless_tracker.records import Observation, TrackResult, TrackState
from markerless_tracker.synthesis import SyntheticScene
from markerless_tracker.tracking import TrackerConfig
from markerless_tracker.tracking.camera_check import (
    EVERY_NS,
    LATER_EVERY_NS,
    MANY_CHECKS,
    CameraCheck,
    Shift,
    describe,
)

CONFIG = TrackerConfig(threads=1)
FRAME_NS = 200_000_000
_FIRST = 400_000_000


@pytest.fixture(scope="module")
def scene():
    return SyntheticScene(body="person31", motion="stand", size_px=(328, 245), seed=3)


def shifted(rig: CameraRig, name: str, du: float, dv: float) -> CameraRig:
    """The rig with one camera's calibration off by that much."""
    moved = {
        camera.name: replace(camera, matrix=camera.matrix + [[0, 0, du], [0, 0, dv], [0, 0, 0]])
        for camera in rig
    }
    return CameraRig(tuple(moved[c.name] if c.name == name else c for c in rig))


def checked(scene, rig, frames: int = 8):
    check = CameraCheck(rig, CONFIG)
    for index in range(frames):
        _, masks, pose = scene.frame(12 * index)
        seen = {
            name: Observation.from_mask(name, 0, mask, np.zeros(mask.shape, np.uint8))
            for name, mask in masks.items()
        }
        check.add(
            TrackResult(
                index * FRAME_NS, TrackState.TRACKING, pose, markers(scene.body, pose), 1.8, {}, 0,
                observations=seen,
            ),
            scene.body,
        )  # fmt: skip
    return check.shifts()


def test_cameras_that_agree_are_not_named(scene) -> None:
    shifts = checked(scene, scene.rig)
    assert set(shifts) == set(scene.rig.names)
    assert all(shift.length_m < 0.01 for shift in shifts.values())
    assert describe(shifts) == []


def test_the_camera_that_is_off_is_named(scene) -> None:
    wrong = shifted(scene.rig, "cam03", -5.0, 3.0)
    shifts = checked(scene, wrong)
    assert [name for name, shift in shifts.items() if shift.disagrees] == ["cam03"]
    np.testing.assert_allclose(shifts["cam03"].px, (5.0, -3.0), atol=1.0)
    (line,) = describe(shifts)
    assert line.startswith("cam03: silhouettes (+")


def test_few_checks_and_lost_frames_say_nothing(scene) -> None:
    assert not Shift((9.0, 9.0), 0.1, 2).disagrees
    check = CameraCheck(scene.rig, CONFIG)
    check.add(TrackResult(0, TrackState.LOST, None, None, float("nan"), {}, 0), scene.body)
    assert check.shifts() == {}


def test_after_many_checks_the_next_ones_come_less_often(scene) -> None:
    dense = MANY_CHECKS * max(EVERY_NS, FRAME_NS)
    later = 2 * LATER_EVERY_NS
    frames = (_FIRST + dense + later) // FRAME_NS + 1
    shifts = checked(scene, scene.rig, frames)
    most = MANY_CHECKS + later // LATER_EVERY_NS
    assert MANY_CHECKS < shifts["cam01"].checks <= most < frames - _FIRST // FRAME_NS


def test_a_second_camera_is_left_out_after_the_worst_one(scene) -> None:
    check = CameraCheck(cameras_like(scene.rig, 6), CONFIG)
    bad = {"cam01": (20.0, 0.0, 200.0), "cam02": (0.0, 16.0, 200.0)}
    for left_out in (set(), {"cam01"}, {"cam01", "cam02"}):
        assert check._suspects == left_out
        for name in check._found:
            check._found[name] = [bad.get(name, (0.0, 0.0, 200.0))] * 8
        check._suspect()


def cameras_like(rig: CameraRig, count: int) -> CameraRig:
    """A rig of so many cameras, all where the first one is."""
    return CameraRig(tuple(replace(rig["cam01"], name=f"cam{i + 1:02d}") for i in range(count)))
