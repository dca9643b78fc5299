"""What a running tracker publishes, heard from another context."""

import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="ROS 2 is not installed")

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import Point, Pose, PoseArray
from sensor_msgs.msg import Image, JointState

from markerless_tracker.cli.main import main
from markerless_tracker.node.ros.images import fill_image
from markerless_tracker.node.ros.qos import latched_qos, output_qos
from markerless_tracker.node.ros.stamps import time_message
from markerless_tracker.node.spectator import Spectator, TrackerMessage

STAMP_NS = 3_050_000_000
PICTURE = np.arange(48 * 64 * 3, dtype=np.uint8).reshape(48, 64, 3)


def stamped(message: Any) -> Any:
    message.header.stamp = time_message(STAMP_NS)
    return message


def kind(heard: TrackerMessage) -> str:
    """Name of the attribute that holds what was heard."""
    if heard.markers_m is not None:
        return "markers_m"
    return next(n for n in ("angles_rad", "pictures", "state") if getattr(heard, n))


def test_all_outputs_are_heard(peer: Any) -> None:
    create = peer.node.create_publisher
    state = create(DiagnosticArray, "state", latched_qos())
    outputs = [
        (create(PoseArray, "marker_poses", output_qos()),
         stamped(PoseArray(poses=[Pose(position=Point(x=float(i))) for i in range(15)]))),
        (create(JointState, "joint_states", output_qos()),
         stamped(JointState(name=["knee_angle_l"], position=[0.5]))),
        (create(Image, "debug/cam02/overlay", output_qos()),
         stamped(fill_image(Image(), PICTURE, "overlay"))),
    ]  # fmt: skip
    values = {"state": "TRACKING", "iou/cam01": "nan", "iou/cam02": "0.9"}

    def publish_state(values: dict[str, str]) -> None:
        pairs = [KeyValue(key=key, value=value) for key, value in values.items()]
        state.publish(stamped(DiagnosticArray(status=[DiagnosticStatus(values=pairs)])))

    publish_state(values)
    found: dict[str, TrackerMessage] = {}

    def complete() -> bool:
        return len(found) == 4

    def publish() -> None:
        # Others use the topic, too.
        publish_state({"iou/cam 1": "0.5"})
        publish_state({"iou/cam01": "good"})
        publish_state(values)
        for publisher, message in outputs:
            publisher.publish(message)

    with Spectator() as spectator:
        until_s = time.monotonic() + 60.0
        while not complete() and time.monotonic() < until_s:
            publish()
            for heard in spectator.listen(until=complete, seconds=0.2):
                if heard is not None:
                    found[kind(heard)] = heard
        assert spectator.cameras == ("cam01", "cam02")
    assert complete() and {heard.stamp_ns for heard in found.values()} == {STAMP_NS}
    np.testing.assert_array_equal(found["markers_m"].markers_m[:, 0], np.arange(15.0))
    assert found["angles_rad"].angles_rad == {"knee_angle_l": 0.5}
    assert (found["state"].state, found["state"].overlap) == ("TRACKING", {"cam02": 0.9})
    np.testing.assert_array_equal(found["pictures"].pictures["cam02"], PICTURE)


def test_without_a_tracker_it_says_so(other_domain: None, tmp_path: Path) -> None:
    words = ["view", "--node", "--seconds", "0.1", "--sheet", str(tmp_path / "live.png")]
    done = subprocess.run(
        [sys.executable, "-m", "markerless_tracker", *words],
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONPATH": str(Path(__file__).resolve().parents[2])},
    )
    assert done.returncode == 3, done.stderr
    assert "no tracker was heard" in done.stderr and not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["out/walk", "--node"], "expected no NAME"),
        (["--node", "--frames", "3"], "expected no NAME, --film, --source, --frames"),
        (["--node", "--whole"], "and --whole"),
        (["out/walk", "--seconds", "2"], "--seconds is given without --node"),
        ([], "expected NAME of a result, or --node"),
    ],
)
def test_what_does_not_go_together_is_refused(words: list[str], reason: str, capsys) -> None:
    assert main(["view", *words]) == 1
    assert reason in capsys.readouterr().err
