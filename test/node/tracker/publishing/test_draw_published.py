"""The picture of what a tracker publishes: markers, TF and URDF of a recorded bag agree."""

import importlib.util
import os
import signal
import subprocess
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="ROS 2 is not installed")

import cv2
import numpy as np

from markerless_tracker.body import MARKER_NAMES


def loaded(path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_markers_frames_and_urdf_of_a_recorded_bag_agree(
    begin: Any, tf2_msgs: dict[str, str], tmp_path: Path, project_root: Path
) -> None:
    live = begin(environment=tf2_msgs)
    bag, log = tmp_path / "published_bag", tmp_path / "record.log"
    topics = "robot_description,tf,tf_static,markers,marker_poses"
    with log.open("wb") as sink:
        recorder = subprocess.Popen(
            [sys.executable, "-m", "markerless_tracker", "record", str(bag), "--topics", topics],
            stdin=subprocess.DEVNULL,
            stdout=sink,
            stderr=sink,
            env={**os.environ, "PYTHONPATH": str(project_root), **tf2_msgs},
        )
    try:
        wanted = [f"recording /{name}" for name in topics.split(",")]
        live.until(lambda: all(line in log.read_text() for line in wanted), "the recorder")
        stamps_ns = [live.camera.scene.stamp_ns(live.track()) for _ in range(5)]
    finally:
        recorder.send_signal(signal.SIGINT)
        assert recorder.wait(120) == 0, log.read_text()
    script = project_root / "docs" / "draw_published.py"
    published = loaded(script).Published(bag, None)
    # The recorder may be ended before the last set has reached it.
    assert published.stamp_ns in stamps_ns
    frames = np.array([published.T[name][:3, 3] for name in MARKER_NAMES])
    np.testing.assert_allclose(frames, published.marker_poses, atol=1e-6)
    np.testing.assert_allclose(published.joints, published.marker_poses, atol=1e-6)
    shown = np.array([T[:3, 3] for T, _, _ in published.cylinders])
    described = np.array([(published.T[link] @ T)[:3, 3] for link, T, *_ in published.visuals])
    assert len(shown) == len(described) == len(live.world.scene.body.cone_names)
    apart = np.linalg.norm(shown[:, None] - described[None], axis=2)
    assert apart.min(axis=1).max() < 1e-3 and apart.min(axis=0).max() < 1e-3

    picture = tmp_path / "published.png"
    subprocess.run([sys.executable, str(script), str(bag), str(picture)], check=True)
    panels = np.hsplit(cv2.imread(str(picture)), 3)
    drawn = [int((panel.min(axis=2) < 200).sum()) for panel in panels]
    assert min(drawn) > 3000
    assert drawn[0] > 3 * drawn[1] and drawn[2] == pytest.approx(drawn[0], rel=0.1)
