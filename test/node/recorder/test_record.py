"""Recording a running graph: what arrives is in the bag, and stays there after a kill."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="ROS 2 is not installed")

from geometry_msgs.msg import PoseArray
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import Image
from std_msgs.msg import String

from markerless_tracker.camera import write_calibration
from markerless_tracker.cli.main import main
from markerless_tracker.datasets import open_recording
from markerless_tracker.datasets.bag.stream import McapFiles
from markerless_tracker.errors import ConfigError
from markerless_tracker.node.recorder.node import RecorderNode
from markerless_tracker.node.ros.images import fill_image
from markerless_tracker.node.ros.qos import image_qos, latched_qos, output_qos
from markerless_tracker.node.ros.stamps import time_message
from markerless_tracker.synthesis.rig import ring_rig

RIG = ring_rig(2, (64, 48))


class Graph:
    """Publishes images of two cameras, poses and a latched text, set by set."""

    def __init__(self, peer: Any) -> None:
        create = peer.node.create_publisher
        self._peer, self.sets = peer, 0
        self._images = {n: create(Image, f"{n}/image_raw", image_qos()) for n in RIG.names}
        self._poses = create(PoseArray, "marker_poses", output_qos())
        self._debug = create(Image, "debug/cam01/overlay", image_qos())
        self._text = create(String, "robot_description", latched_qos())
        self._text.publish(String(data="<robot/>"))

    @property
    def heard(self) -> bool:
        publishers = (*self._images.values(), self._poses, self._text)
        return all(publisher.get_subscription_count() for publisher in publishers)

    def picture(self, name: str, number: int) -> np.ndarray:
        rng = np.random.default_rng([number, int(name[-1])])
        return rng.integers(0, 256, (48, 64, 3), dtype=np.uint8)

    def publish(self) -> None:
        stamp = self.sets * 50_000_000
        for name, publisher in self._images.items():
            picture = self.picture(name, self.sets)
            message = fill_image(Image(), picture, name)
            message.header.stamp = time_message(stamp)
            publisher.publish(message)
        poses = PoseArray()
        poses.header.stamp = time_message(stamp)
        self._poses.publish(poses)
        self.sets += 1


@pytest.fixture
def recorder(tmp_path: Path) -> Iterator[Callable[..., Any]]:
    """`recorder(*words)`: the verb `record` as a process that writes to `bag`."""
    started = []
    calibration = tmp_path / "calibration.toml"
    write_calibration(calibration, RIG)

    def begin(*words: str) -> Any:
        given = [str(tmp_path / "bag"), "--calibration", str(calibration), "--json", *words]
        process = subprocess.Popen(
            [sys.executable, "-m", "markerless_tracker", "record", *given],
            stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
            env={**os.environ, "PYTHONPATH": str(Path(__file__).resolve().parents[3])},
        )  # fmt: skip
        started.append(process)
        return process

    yield begin
    for process in started:
        process.kill()
        process.communicate()


def check_bag(folder: Path, graph: Graph, least: int) -> None:
    """The sets in the bag are the first ones that were sent, at least so many, bit for bit."""
    frames = list(open_recording(folder).frames())
    assert len(frames) >= least
    for number, frame in enumerate(frames):
        assert frame.stamp_ns == number * 50_000_000
        for name in RIG.names:
            np.testing.assert_array_equal(frame.images[name], graph.picture(name, number))


def test_what_arrives_is_in_the_bag(peer: Any, recorder, tmp_path: Path) -> None:
    process, graph = recorder(), Graph(peer)
    peer.until(lambda: graph.heard, "the recorder")
    for _ in range(10):
        graph.publish()
        peer.until(lambda: True, "")
        time.sleep(0.02)
    time.sleep(1.0)
    process.send_signal(signal.SIGINT)
    out, _ = process.communicate(timeout=120)
    summary = json.loads(out)
    assert process.returncode == 0
    # The tracker draws images for debugging as soon as somebody subscribes to them.
    assert "/debug/cam01/overlay" not in summary["topics"]
    # The middleware may lose images under load, but not the latched text.
    assert summary["topics"]["/robot_description"] == 1
    assert set(summary["topics"]) == {
        "/cam01/image_raw", "/cam02/image_raw", "/marker_poses", "/robot_description",
    }  # fmt: skip
    check_bag(tmp_path / "bag", graph, 10)
    types = McapFiles([tmp_path / "bag" / "bag.mcap"]).types
    assert types["/marker_poses"] == "geometry_msgs/msg/PoseArray"
    assert (tmp_path / "bag" / "metadata.yaml").is_file()


def test_a_kill_leaves_what_was_flushed(peer: Any, recorder, tmp_path: Path) -> None:
    process, graph = recorder("--topics", "cam01/image_raw,/cam02/image_raw"), Graph(peer)
    file = tmp_path / "bag" / "bag.mcap"
    peer.until(
        lambda: all(p.get_subscription_count() for p in graph._images.values()), "the recorder"
    )

    def stored() -> int:
        graph.publish()
        time.sleep(0.02)
        return sum(1 for _ in McapFiles([file])) if file.stat().st_size > 8 else 0

    least = peer.until(stored, "a chunk in the file")
    process.send_signal(signal.SIGKILL)
    process.wait()
    check_bag(tmp_path / "bag", graph, least // 2)
    assert set(McapFiles([file]).types) <= {"", "/cam01/image_raw", "/cam02/image_raw"}


class KeptWords:
    """Keeps the serialised messages of each topic."""

    def __init__(self) -> None:
        self.words: dict[str, list[bytes]] = {}
        self.messages = 0

    def topic(self, name: str, kind: str, *, latched: bool = False) -> str:
        self.words[name] = []
        return name

    def write_serialized(self, topic: str, stamp_ns: int, data: bytes) -> None:
        self.words[topic].append(data)

    def flush(self) -> None:
        """Do nothing."""


def test_a_publisher_that_returns_as_best_effort_is_recorded_on(
    peer: Any, ros_context: Any
) -> None:
    bag = KeptWords()
    node = RecorderNode(bag, ["words"], context=ros_context)
    peer.executor.add_node(node)
    effort = QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)
    for qos, text in ((QoSProfile(depth=5), b"first"), (effort, b"second")):
        publisher = peer.node.create_publisher(String, "words", qos)

        def heard(publisher: Any = publisher, text: bytes = text) -> bool:
            publisher.publish(String(data=text.decode()))
            return any(text in data for data in bag.words.get("/words", []))

        peer.until(heard, text.decode())
        peer.node.destroy_publisher(publisher)
        peer.until(lambda: peer.node.count_publishers("words") == 0, "no publisher")
    node.destroy_node()


def test_topics_of_ros_itself_are_recorded_on_demand(peer: Any, ros_context: Any) -> None:
    bag = KeptWords()
    node = RecorderNode(bag, ["/rosout"], context=ros_context)
    peer.executor.add_node(node)
    peer.until(lambda: "/rosout" in bag.words, "the topic")
    node.destroy_node()


def test_mistakes_and_silence(recorder, tmp_path: Path) -> None:
    for _ in range(2):
        process = recorder("--topics", "/nobody", "--seconds", "0.2")
        out, _ = process.communicate(timeout=120)
        assert process.returncode == 3 and json.loads(out)["messages"] == 0
        assert not (tmp_path / "bag").exists()
    (tmp_path / "bag").mkdir()
    (tmp_path / "bag" / "notes.txt").touch()
    process = recorder()
    assert process.wait(120) == 1


def test_topics_that_never_came_are_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def recorded(writer: Any, stop: Any, *, topics: Any, **_: Any) -> dict[str, int]:
        assert topics == ("cam01/image_raw", "cam02/image_raw", "/poses")
        return {"/cam01/image_raw": 3, "/poses": 0}

    monkeypatch.setattr("markerless_tracker.node.recorder.process.record", recorded)
    words = ["--topics", "cam01/image_raw, cam02/image_raw,/poses"]
    assert main(["record", str(tmp_path / "bag"), *words]) == 0
    err = " ".join(capsys.readouterr().err.split())
    assert "no message came on cam02/image_raw, /poses" in err


def test_a_recording_that_did_not_begin_leaves_no_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(*_: Any, **__: Any) -> dict[str, int]:
        raise ConfigError("no such domain")

    monkeypatch.setattr("markerless_tracker.node.recorder.process.record", refused)
    write_calibration(tmp_path / "calibration.toml", RIG)
    words = ["--calibration", str(tmp_path / "calibration.toml")]
    (tmp_path / "empty").mkdir()
    for name in ("new", "empty"):
        assert main(["record", str(tmp_path / name), *words]) == 1
    assert not (tmp_path / "new").exists() and not any((tmp_path / "empty").iterdir())


@pytest.mark.parametrize("words", [["record", "bag"], ["view", "--node"]])
@pytest.mark.parametrize("seconds", ["-1", "0", "nan", "some"])
def test_impossible_durations_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], words: list[str], seconds: str
) -> None:
    given = [*words[:1], *(str(tmp_path / "bag") if w == "bag" else w for w in words[1:])]
    with pytest.raises(SystemExit) as stop:
        main([*given, f"--seconds={seconds}"])
    assert stop.value.code == 2 and f"{seconds!r}, expected a number" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
