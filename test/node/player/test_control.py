"""A player under control: pause, step, resume, `/clock`, a choice of topics, a cut bag."""

import re
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="ROS 2 is not installed")

from geometry_msgs.msg import PoseArray
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CameraInfo, Image
from std_srvs.srv import Trigger

from markerless_tracker.bags import write_bag
from markerless_tracker.datasets import open_recording, read_trc
from markerless_tracker.node.player.node import PlayerNode
from markerless_tracker.node.player.others import END_NS
from markerless_tracker.node.player.spin import never
from markerless_tracker.node.ros.qos import image_qos, output_qos
from markerless_tracker.node.ros.stamps import stamp_of

SETS = 6


@pytest.fixture(scope="module")
def bag(walk, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Six sets at 30 Hz with reference markers."""
    folder = tmp_path_factory.mktemp("control") / "bag"
    write_bag(open_recording(walk, scale=0.25), folder)
    return folder


def ask(peer: Any, service: str) -> Any:
    client = peer.node.create_client(Trigger, service)
    peer.until(client.service_is_ready, service)
    # A service that has not yet discovered its client answers into the void.
    found_s = time.monotonic()
    peer.until(lambda: time.monotonic() - found_s > 0.5, "half a second")
    future = client.call_async(Trigger.Request())
    peer.until(future.done, f"an answer of {service}")
    return future.result()


def test_pause_step_and_resume(bag: Path, peer: Any, start: Callable[..., Any]) -> None:
    images = peer.collect(Image, "cam01/image_raw", image_qos(depth=50))
    player = start("player", bag=bag, paused=True)
    assert ask(peer, "/player/step").message == "the next set is sent"
    peer.until(lambda: len(images) == 1, "the first set")
    assert ask(peer, "/player/step").success
    peer.until(lambda: len(images) == 2, "the second set")
    assert ask(peer, "/player/pause").success and len(images) == 2
    assert ask(peer, "/player/resume").message == "playing"
    peer.until(lambda: len(images) == SETS, "the rest")
    peer.until(lambda: not player.running, "the player to end")
    assert player.wait() == 0, player.output
    assert "could not keep pace" not in player.output
    assert [round(stamp_of(image) * 30 / 1e9) for image in images] == list(range(SETS))


@pytest.mark.parametrize("sets", [SETS, 4], ids=["whole", "ended"])
def test_a_player_that_falls_behind_says_by_how_much(
    bag: Path, ros_context: Any, monkeypatch: pytest.MonkeyPatch, sets: int
) -> None:
    given = [Parameter("bag", value=str(bag)), Parameter("rate", value=5.0)]
    node = PlayerNode(context=ros_context, parameter_overrides=given)
    warnings: list[str] = []
    logger = SimpleNamespace(info=lambda text: None, warning=warnings.append)
    monkeypatch.setattr(node, "get_logger", lambda: logger)
    monkeypatch.setattr(node, "_discover", lambda spin: True)
    sent: list[Any] = []

    def slowly(played: Any) -> None:
        sent.append(played)
        time.sleep(0.1)

    monkeypatch.setattr(node, "_publish", slowly)
    node.play(lambda seconds, until=never: len(sent) < sets)
    node.destroy_node()
    # The sets are 1/150 s apart, each takes 0.1 s, the last one is not counted.
    (warning,) = warnings
    late_s = float(re.search(r"was sent (.*) s late at rate 5$", warning).group(1))
    assert 0.8 * (sets - 2) * 0.1 < late_s < (sets + 1) * 0.1 + 1.0


def test_in_lockstep_no_wait_goes_on_after_the_answer(
    bag: Path, ros_context: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    given = [Parameter("bag", value=str(bag)), Parameter("lockstep", value=True)]
    node = PlayerNode(context=ros_context, parameter_overrides=given)
    sent: list[Any] = []
    answered: list[bool] = []

    def spin(seconds: float, until: Callable[[], bool] = never) -> bool:
        """A tracker answers during the first wait for each set."""
        if sent and not until():
            stamp_ns = str(sent[-1].stamp_ns)
            node._lockstep.update("tracker", {"ready": "true", "dealt_with_ns": stamp_ns})
            answered.append(until())
        return True

    node._lockstep.update("tracker", {"ready": "true", "dealt_with_ns": ""})
    monkeypatch.setattr(node, "_discover", lambda spin: True)
    monkeypatch.setattr(node, "_publish", sent.append)
    node.play(spin)
    node.destroy_node()
    assert len(sent) == SETS and answered == [True] * SETS


def test_what_was_recorded_after_the_last_set_is_published(
    bag: Path, ros_context: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of the messages that `up_to` gives before and after each set, none is left out."""
    given = [Parameter("bag", value=str(bag)), Parameter("rate", value=5.0)]
    node = PlayerNode(context=ros_context, parameter_overrides=given)
    published: list[int] = []
    stored = list(range(SETS + 3))

    def take(first_ns: int, last_ns: int) -> list[int]:
        count = len(stored) if last_ns == END_NS else 1
        taken, stored[:count] = stored[:count], []
        return taken

    monkeypatch.setattr(node._others, "up_to", lambda later: take)
    monkeypatch.setattr(node._others, "publish", published.extend)
    node.play(lambda seconds, until=never: True)
    node.destroy_node()
    assert published == list(range(SETS + 3))


def test_a_step_needs_a_pause(bag: Path, peer: Any, start: Callable[..., Any]) -> None:
    start("player", bag=bag, loop=True)
    answer = ask(peer, "/player/step")
    assert not answer.success and answer.message == "playing, expected ~/pause first"


def test_clock_and_chosen_topics(walk, bag: Path, peer: Any, start: Callable[..., Any]) -> None:
    clocks = peer.collect(Clock, "/clock", output_qos())
    poses = peer.collect(PoseArray, "/ground_truth/marker_poses", output_qos())
    images = peer.collect(Image, "cam02/image_raw", image_qos(depth=50))
    others = [
        peer.collect(Image, "cam01/image_raw", image_qos(depth=50)),
        peer.collect(CameraInfo, "cam02/camera_info", image_qos(depth=50)),
    ]
    topics = "[cam02/image_raw, /ground_truth/marker_poses]"
    player = start("player", bag=bag, topics=topics, clock=100.0, rate=0.2, paused=True)
    ask(peer, "/player/resume")
    peer.until(lambda: not player.running, "the player to end")
    assert player.wait() == 0, player.output
    assert len(images) == len(poses) == SETS and others == [[], []]
    truth = read_trc(walk / "ground_truth.trc")
    assert [stamp_of(message) for message in poses] == [stamp_of(image) for image in images]
    found = [[p.position.x, p.position.y, p.position.z] for p in poses[-1].poses]
    np.testing.assert_allclose(found, truth.positions_m[-1], atol=1e-9)
    times = [clock.clock.sec * 10**9 + clock.clock.nanosec for clock in clocks]
    assert times == sorted(times) and {stamp_of(image) for image in images} <= set(times)
    # Between the sets, too.
    assert len(set(times)) > 3 * SETS and times[-1] == stamp_of(images[-1])


def test_a_topic_that_the_bag_lacks(bag: Path, start: Callable[..., Any]) -> None:
    player = start("player", bag=bag, topics="[cam01/image_raw, cam09/image_raw]")
    assert player.wait() == 1
    assert "topics: /cam09/image_raw is not in the bag, expected some of /cam01/" in player.output


def test_a_cut_bag_is_played_up_to_the_cut(
    bag: Path, tmp_path: Path, peer: Any, start: Callable[..., Any]
) -> None:
    (tmp_path / "cut").mkdir()
    file = tmp_path / "cut" / "bag.mcap"
    content = (bag / "bag.mcap").read_bytes()
    file.write_bytes(content[: len(content) // 2])
    images = peer.collect(Image, "cam01/image_raw", image_qos(depth=50))
    player = start("player", bag=tmp_path / "cut", paused=True)
    ask(peer, "/player/resume")
    peer.until(lambda: not player.running, "the player to end")
    assert player.wait() == 0, player.output
    assert 0 < len(images) < SETS
    assert player.output.count("cut or damaged, read up to there") == 1
