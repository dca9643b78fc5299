"""Cameras that are wrong, corrected by the contours of a made-up person."""

from dataclasses import replace

import numpy as np
import pytest

from markerless_tracker.calibration.contours.cameras import moved
from markerless_tracker.calibration.contours.frames import SeenFrame
from markerless_tracker.calibration.contours.refine import refine_cameras
from markerless_tracker.calibration.contours.report import describe_refinement
from markerless_tracker.camera import CameraRig, project_camera
from markerless_tracker.drawing import silhouette
from markerless_tracker.errors import CalibrationError
from markerless_tracker.records import Observation
from markerless_tracker.synthesis import SyntheticScene
from markerless_tracker.tracking import TrackerConfig

BODY = "person31"
CONFIG = TrackerConfig(body=BODY, threads=1)
CHANGE = np.array([np.deg2rad(0.6), np.deg2rad(0.7), np.deg2rad(-0.4), 0.02, -0.02, 0.01, 0.01])
"""1 degree, 3 cm and 1 %."""
SIZE = (328, 245)


def walked(motion: str, count: int = 8) -> tuple[SyntheticScene, list[SeenFrame]]:
    """Frames of a motion with true silhouettes and poses."""
    scene = SyntheticScene(body=BODY, motion=motion, size_px=SIZE, fps=2.0, seed=3)
    frames = []
    for index in range(count):
        pose = scene.pose(index)
        seen = {}
        for camera in scene.rig:
            mask = silhouette(scene.body, pose, camera, samples=3)
            seen[camera.name] = Observation.from_mask(
                camera.name, 0, mask, np.zeros(mask.shape, np.uint8)
            )
        frames.append(SeenFrame(index, pose, scene.markers(index), seen))
    return scene, frames


@pytest.fixture(scope="module")
def walk() -> tuple[SyntheticScene, list[SeenFrame]]:
    return walked("walk")


def touched(rig: CameraRig, name: str) -> CameraRig:
    return CameraRig(tuple(moved(c, CHANGE) if c.name == name else c for c in rig))


def off_px(rig: CameraRig, true: CameraRig, frames: list[SeenFrame], name: str) -> float:
    """Root mean square error of the joints' images in one camera."""
    points = np.concatenate([frame.markers_m for frame in frames])
    error = project_camera(points, rig[name]) - project_camera(points, true[name])
    return float(np.sqrt((error**2).sum(axis=1).mean()))


def test_the_camera_that_was_touched_is_restored_and_no_other(walk) -> None:
    scene, frames = walk
    wrong = touched(scene.rig, "cam03")
    found = refine_cameras(wrong, scene.body, CONFIG, frames)
    assert [name for name, one in found.cameras.items() if one.corrected] == ["cam03"]
    rig = found.applied(wrong)
    assert off_px(wrong, scene.rig, frames, "cam03") > 3.0
    assert off_px(rig, scene.rig, frames, "cam03") < 0.3
    assert all(rig[n] is wrong[n] for n in ("cam01", "cam02", "cam04"))
    one = found.cameras["cam03"]
    away = moved(scene.rig["cam03"], CHANGE)
    points = np.concatenate([frame.markers_m for frame in frames])
    shift = project_camera(points, scene.rig["cam03"]) - project_camera(points, away)
    np.testing.assert_allclose(one.before_px, shift.mean(axis=0), atol=0.3)
    assert np.hypot(*one.after_px) < 0.2
    assert found.anchored and (one.sd > 0.0).all() and one.held == ()
    lines = describe_refinement(found)
    assert lines[0].startswith("cam03 corrected: silhouettes (")
    assert lines[1] == "cam01, cam02, cam04: agree and stay as they are"
    assert found.as_mapping()["cameras"]["cam03"]["corrected"]
    # The same cameras in images of twice the size.
    large = refine_at_scale(found, wrong)
    np.testing.assert_allclose(
        large["cam03"].T_cam_world, rig["cam03"].T_cam_world, rtol=0.0, atol=1e-12
    )


def refine_at_scale(found, wrong: CameraRig) -> CameraRig:
    return found.applied(wrong.scaled(2.0))


def test_cameras_that_agree_stay_as_they_are(walk) -> None:
    scene, frames = walk
    found = refine_cameras(scene.rig, scene.body, CONFIG, frames)
    assert not any(one.corrected for one in found.cameras.values())
    assert all(a is b for a, b in zip(found.applied(scene.rig), scene.rig, strict=True))
    assert all(np.hypot(*one.before_px) < 0.5 for one in found.cameras.values())


def test_a_person_who_stands_still_is_refused() -> None:
    scene, frames = walked("stand")
    wrong = touched(scene.rig, "cam03")
    with pytest.raises(CalibrationError, match=r"hardly moves: 8 frames are as good as 1\.\d"):
        refine_cameras(wrong, scene.body, CONFIG, frames)


def test_two_cameras_or_no_frame_are_refused(walk) -> None:
    scene, frames = walk
    two = scene.rig.selected(["cam01", "cam02"])
    only = [replace(f, observations={n: f.observations[n] for n in two.names}) for f in frames]
    with pytest.raises(CalibrationError, match="2 cameras see the person: either may be wrong"):
        refine_cameras(two, scene.body, CONFIG, only)
    with pytest.raises(CalibrationError, match="no frame was tracked"):
        refine_cameras(scene.rig, scene.body, CONFIG, [])


def test_a_camera_that_sees_nobody_is_not_judged(walk) -> None:
    scene, frames = walk
    three = ("cam01", "cam02", "cam03")
    only = [replace(f, observations={n: f.observations[n] for n in three}) for f in frames[::2]]
    found = refine_cameras(scene.rig, scene.body, CONFIG, only)
    assert describe_refinement(found)[1].startswith("cam04: never compared")
    assert found.as_mapping()["cameras"]["cam04"]["shift_px"]["before"] is None
