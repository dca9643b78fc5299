"""The service `~/learn_background`, over the real middleware."""

import shutil
import time
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="ROS 2 is not installed")

from std_srvs.srv import Trigger

from markerless_tracker.imaging import read_background_model


def spin_a_while(live: Any) -> None:
    end_s = time.monotonic() + 0.3
    live.until(lambda: time.monotonic() > end_s, "the next set")


def test_the_background_is_learned_from_the_empty_scene(
    world: Any, tmp_path: Path, begin: Any, peer: Any, scenes: Any
) -> None:
    folder = tmp_path / "background"
    shutil.copytree(world.folder / "background", folder)
    live = begin(background_dir=folder, learn_background_sets=4, threads=0)
    client = peer.node.create_client(Trigger, "tracker/learn_background")
    live.until(client.service_is_ready, "the service")

    def learn(scene: Any) -> Any:
        future = client.call_async(Trigger.Request())
        while not future.done():
            live.camera.scene = scene
            live.send_without_pose()
            end_s = time.monotonic() + 0.3
            live.until(
                lambda end_s=end_s: future.done() or time.monotonic() > end_s, "the next set"
            )
        return future.result()

    live.track()
    answer = learn(world.scene)
    assert not answer.success and "a person is tracked" in answer.message, answer
    assert not list(folder.glob("*.npz"))

    moved = scenes.Refurnished(world.scene, empty=True)
    answer = learn(moved)
    assert answer.success, answer.message
    model = read_background_model(folder / "cam02.npz")
    assert abs(model.mean[moved.window] - moved.colour).max() < 4.0
    live.until(lambda: live.value("state") == "SEARCHING", "a new beginning")

    live.camera.scene = scenes.Refurnished(world.scene, empty=False)
    for _ in range(3):
        live.track()
    assert live.value("state") == "TRACKING" and live.value("warnings") == ""
    assert all(float(live.value(f"iou/{name}")) > 0.8 for name in live.camera.names)


def test_a_node_without_background_waits_for_one(
    world: Any, tmp_path: Path, begin: Any, peer: Any, scenes: Any
) -> None:
    folder = tmp_path / "background"
    live = begin(background_dir=folder, learn_background_sets=3, wait_for_background=True)
    live.send_without_pose()
    live.until(lambda: live.value("activity") == "waiting for learn_background", "to wait")
    client = peer.node.create_client(Trigger, "tracker/learn_background")
    live.until(client.service_is_ready, "the service")
    live.camera.scene = scenes.Refurnished(world.scene, empty=True)
    # An image of the person may be under way when the request comes: it is refused then.
    for _ in range(3):
        future = client.call_async(Trigger.Request())
        while not future.done():
            live.send_without_pose()
            spin_a_while(live)
        if future.result().success:
            break
    assert future.result().success, future.result().message
    assert len(list(folder.glob("*.npz"))) == len(live.camera.names)
    live.camera.scene = scenes.Refurnished(world.scene, empty=False)
    live.track()
    assert live.value("state") == "TRACKING" and live.value("dropped_on_error") == "0"
