"""A camera whose stamps are late by a constant time, over the real middleware."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="ROS 2 is not installed")

from markerless_tracker.body import write_pose
from markerless_tracker.synthesis.scene import SyntheticScene

FPS = 100.0 / 3.0
LATE_NS = 30_000_000
MOST_FRAMES = 900


@pytest.fixture
def walking(
    world: Any, scenes: Any, other_domain: None, start: Any, peer: Any, tmp_path: Path
) -> Callable[..., Any]:
    """Starts a tracker before which the person of the world walks."""
    scene = SyntheticScene(
        body=world.scene.body, size_px=(328, 245), fps=FPS, samples=1, motion="walk"
    )
    write_pose(tmp_path / "walk.yaml", scene.body, scene.pose(1))

    def begun(**parameters: Any) -> Any:
        given = {**world.parameters(), "start_file": tmp_path / "walk.yaml", "threads": 1}
        given |= parameters
        live = scenes.Live(peer, start("tracker", **given), replace(world, scene=scene))
        live.next = 1
        return live

    return begun


def send(live: Any, shown: int, stamp_ns: int) -> None:
    """Send the next set, in which cam02 shows another frame at another time; wait for its pose.

    Sets show every second frame: offsets are estimated from no more of them.
    """
    live.track(cam02=live.camera.message("cam02", shown, stamp_ns))
    live.next += 1


def test_a_late_camera_is_told_with_the_parameter_that_corrects_it(walking: Any) -> None:
    live = walking()
    says = "images are late, by the person's motion: cam02 by +"
    while says not in live.process.output:
        assert live.next < MOST_FRAMES, live.values
        send(live, live.next - 1, live.camera.scene.stamp_ns(live.next))
    assert 18.0 < float(live.value("late_ms/cam02")) < 36.0
    assert float(live.value("late_sd_ms/cam02")) < 9.0
    assert abs(float(live.value("late_ms/cam01"))) < 6.0
    line = next(line for line in live.process.output.splitlines() if says in line)
    values = line.split('stamp_offsets:="[')[1].split("]")[0].split(", ")
    assert 0.018 < float(values[1]) < 0.036
    assert [float(values[i]) for i in (0, 2, 3)] == [0.0, 0.0, 0.0]
    for _ in range(5):
        send(live, live.next - 1, live.camera.scene.stamp_ns(live.next))
    assert live.process.output.count(says) == 1


def test_a_late_camera_that_is_corrected_is_in_step(walking: Any) -> None:
    live = walking(stamp_offsets="[0.0, 0.03, 0.0, 0.0]")
    while live.value("late_ms/cam02") in ("", "nan"):
        assert live.next < MOST_FRAMES, live.values
        send(live, live.next, live.camera.scene.stamp_ns(live.next) + LATE_NS)
    assert abs(float(live.value("late_ms/cam02"))) < 6.0
    assert "images are late" not in live.process.output
