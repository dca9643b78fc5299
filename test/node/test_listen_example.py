"""`examples/listen.py` as a process, with a publisher of its own test."""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

DEADLINE_S = 120.0


def test_the_example_hears_marker_poses(peer: Any, project_root: Path) -> None:
    pytest.importorskip("rclpy", reason="ROS 2 is not installed")
    from geometry_msgs.msg import PoseArray

    from markerless_tracker import MARKER_NAMES
    from markerless_tracker.node.ros.messages import marker_poses
    from markerless_tracker.node.ros.qos import output_qos

    publisher = peer.node.create_publisher(PoseArray, "marker_poses", output_qos())
    example = subprocess.Popen(
        [sys.executable, str(project_root / "examples" / "listen.py"), "--count", "2"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": str(project_root)},
    )
    try:
        peer.until(
            lambda: publisher.get_subscription_count() or example.poll() is not None,
            "the example's subscription",
            deadline_s=DEADLINE_S,
        )
        markers_m = np.zeros((15, 3))
        markers_m[MARKER_NAMES.index("LWrist"), 2] = 0.8
        markers_m[MARKER_NAMES.index("RWrist"), 2] = 1.25
        for second in (3, 4):
            publisher.publish(marker_poses(markers_m, second * 10**9))
        out, err = example.communicate(timeout=DEADLINE_S)
    finally:
        example.kill()
        example.wait()
    assert example.returncode == 0, err
    assert out.splitlines() == [
        "3.000000000 left 0.800 m, right 1.250 m",
        "4.000000000 left 0.800 m, right 1.250 m",
    ]
