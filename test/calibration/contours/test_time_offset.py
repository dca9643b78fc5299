"""Offsets of cameras from made-up silhouettes of a person whose pose is known."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from markerless_tracker.body import markers
from markerless_tracker.calibration.contours.time_offset import SELDOM_NS, TimeOffsetEstimate
from markerless_tracker.records import Observation, TrackResult, TrackState
from markerless_tracker.synthesis.scene import SyntheticScene

FPS = 40.0
NAMES = ("cam01", "cam02", "cam03", "cam04")


class Scene(SyntheticScene):
    """A person whose silhouettes are rendered once for all tests."""

    def __init__(self, motion: str) -> None:
        super().__init__(size_px=(328, 245), fps=FPS, samples=2, motion=motion)
        self._masks: dict[int, Mapping[str, Any]] = {}

    def masks(self, index: int) -> Mapping[str, Any]:
        """The exact silhouettes of a frame, by camera."""
        if index not in self._masks:
            self._masks[index] = self.frame(index)[1]
        return self._masks[index]


@pytest.fixture(scope="module")
def walk() -> Scene:
    return Scene("walk")


def seen(scene: Scene, index: int, late: Mapping[str, int]) -> dict[str, Observation]:
    """The exact silhouettes, of some cameras those of earlier frames."""
    found = {}
    masks = {frames: scene.masks(index - frames) for frames in {0, *late.values()}}
    for name in scene.rig.names:
        mask = masks[late.get(name, 0)][name]
        edges = np.zeros(mask.shape, np.uint8)
        stamp_ns = scene.stamp_ns(index)
        found[name] = Observation.from_mask(name, stamp_ns, mask, edges)
    return found


def estimate(
    scene: Scene,
    late: Mapping[str, int],
    frames: int,
    state: TrackState = TrackState.TRACKING,
    effort: float = 1.0,
) -> TimeOffsetEstimate:
    made = TimeOffsetEstimate(scene.rig, step_px=2.0)
    for index in range(2, 2 + frames):
        pose = scene.pose(index)
        result = TrackResult(
            scene.stamp_ns(index), state, pose, markers(scene.body, pose), 1.0, {}, 0,
            observations=seen(scene, index, late) if index % 3 == 0 else {}, effort=effort,
        )  # fmt: skip
        made.add(result, scene.body)
    return made


def test_a_late_camera_is_found_with_its_offset(walk: Scene) -> None:
    found = estimate(walk, {"cam02": 1}, 300).by_camera
    assert tuple(found) == NAMES
    assert found["cam02"].certain
    assert found["cam02"].offset_s == pytest.approx(1.0 / FPS, rel=0.2)
    others = [found[name] for name in NAMES if name != "cam02"]
    assert not any(one.certain for one in others)
    assert max(abs(one.offset_s) for one in others) < 0.004


def test_an_early_camera_has_a_negative_offset(walk: Scene) -> None:
    found = estimate(walk, {"cam02": -1}, 400).by_camera
    assert found["cam02"].offset_s == pytest.approx(-1.0 / FPS, rel=0.2)


def test_cameras_in_step_have_no_offset(walk: Scene) -> None:
    found = estimate(walk, {}, 150).by_camera
    assert max(abs(one.offset_s) for one in found.values()) < 0.003
    assert not any(one.certain for one in found.values())


def test_nothing_is_said_without_motion_or_track(walk: Scene) -> None:
    # Cameras in step: of one that is late nothing would be said yet.
    assert not estimate(Scene("stand"), {}, 150).by_camera
    assert not estimate(walk, {}, 150, TrackState.LOST).by_camera


def test_frames_are_used_seldom_while_the_tracker_is_overloaded(
    walk: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    used_ns: list[int] = []
    take = TimeOffsetEstimate._take

    def noted(self: TimeOffsetEstimate, result: TrackResult, *rest: Any) -> None:
        used_ns.append(result.stamp_ns)
        take(self, result, *rest)

    monkeypatch.setattr(TimeOffsetEstimate, "_take", noted)
    estimate(walk, {}, 100)
    assert len(used_ns) > 30
    used_ns.clear()
    estimate(walk, {}, 100, effort=0.8)
    assert len(used_ns) == 3 and min(np.diff(used_ns)) >= SELDOM_NS
