"""Faults of cameras while a person is tracked, and damaged messages between good ones.

One tracker serves all tests of this file: each leaves it tracking.
"""

import array
import os
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="ROS 2 is not installed")

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseArray
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.serialization import serialize_message
from sensor_msgs.msg import CameraInfo, Image

from markerless_tracker.node.ros.camera_info import info_of
from markerless_tracker.node.ros.images import fill_image
from markerless_tracker.node.ros.messages import header
from markerless_tracker.node.ros.qos import output_qos

HOUR_NS = 3600 * 10**9
LONG_MESSAGES = 10_000


@pytest.fixture(autouse=True)
def _spared_checks(monkeypatch: pytest.MonkeyPatch) -> None:
    """rclpy checks assigned bytes one by one where that is asked for."""
    monkeypatch.delenv("ROS_PYTHON_CHECK_FIELDS", raising=False)


def filled(live: Any, name: str, index: int, picture: np.ndarray) -> Image:
    return fill_image(Image(header=header(live.camera.scene.stamp_ns(index))), picture, name)


def assert_tracking(live: Any) -> None:
    index = live.track()
    error = np.linalg.norm(live.points() - live.camera.scene.markers(index), axis=1).mean()
    assert live.value("state") == "TRACKING" and error < 0.03


def test_padded_rows_are_an_image(live: Any) -> None:
    live.track()
    refused, index = live.value("refused/cam02"), live.next
    message = live.camera.message("cam02", index)
    rows = np.frombuffer(bytes(message.data), np.uint8).reshape(message.height, -1)
    message.step += 24
    message.data = array.array("B", np.pad(rows, ((0, 0), (0, 24))).tobytes())
    live.track(cam02=message)
    assert live.value("refused/cam02") == refused and live.value("iou/cam02") != "nan"


def test_truncated_data_cost_their_set_only(live: Any) -> None:
    live.track()
    refused = int(live.value("refused/cam02"))
    message = live.camera.message("cam02", live.next)
    message.data = message.data[:1000]
    live.send_without_pose(cam02=message)
    live.until(lambda: int(live.value("refused/cam02")) == refused + 1, "the refusal")
    assert live.value("last_error").startswith("cam02/image_raw: 1000 bytes in rows of 984")
    assert_tracking(live)


@pytest.mark.parametrize("kind", ["black", "white", "noise"])
def test_a_camera_that_shows_nothing_of_the_scene(live: Any, kind: str) -> None:
    live.track()
    shape, index = (245, 328, 3), live.next
    noise = np.random.default_rng(5).integers(0, 256, shape, dtype=np.uint8)
    picture = {"black": np.zeros_like(noise), "white": np.full_like(noise, 255), "noise": noise}
    live.track(cam03=filled(live, "cam03", index, picture[kind]))
    error = np.linalg.norm(live.points() - live.camera.scene.markers(index), axis=1).mean()
    assert live.value("state") == "TRACKING" and error < 0.05


def test_a_camera_whose_images_arrive_late_is_waited_for(live: Any) -> None:
    index = live.track()
    late = {i: live.camera.message("cam04", i) for i in range(index + 1, index + 4)}
    for i in late:
        live.camera.send(i, cam04=None)
    live.next += len(late)
    for message in late.values():
        live.camera.images["cam04"].publish(message)
    stamp_ns = live.camera.scene.stamp_ns(max(late))
    live.until(lambda: live.value("stamp_ns") == str(stamp_ns), "the last of the late sets")
    assert live.value("iou/cam04") != "nan"


def test_a_clock_that_jumps_forward_keeps_the_track(live: Any) -> None:
    live.track()
    scene = live.camera.scene
    restarts = live.value("restarts")
    for _ in range(2):
        live.track_at(live.next, scene.stamp_ns(live.next) + HOUR_NS)
        live.next += 1
    assert live.value("state") == "TRACKING" and live.value("restarts") == restarts
    # Back again: two late sets, then it is the time.
    for _ in range(2):
        live.send_without_pose()
    assert_tracking(live)


def test_a_camera_info_that_is_no_number(live: Any) -> None:
    live.track()
    message = info_of(live.world.scene.rig["cam01"], 0)
    message.k[4] = float("nan")
    live.camera.infos["cam01"].publish(message)
    live.until(lambda: "cam01/camera_info: " in live.process.output, "the line")
    live.camera.infos["cam01"].publish(info_of(live.world.scene.rig["cam01"], 0))
    live.send_until(lambda: live.value("iou/cam01") != "nan", "cam01 again")
    assert_tracking(live)


def test_a_subscriber_that_never_reads_holds_nothing_up(live: Any) -> None:
    context = rclpy.Context()
    rclpy.init(context=context, args=[])
    try:
        node = Node("sleeper", context=context)
        node.create_subscription(PoseArray, "marker_poses", print, output_qos())
        for _ in range(3):
            live.track()
        node.destroy_node()
    finally:
        context.try_shutdown()
    assert_tracking(live)


def test_cameras_that_are_started_again_go_on(live: Any, scenes: Any) -> None:
    """As a player that is killed and begins the bag anew: time goes back."""
    live.track()
    old, node = live.camera, live.peer.node
    for publisher in (*old.images.values(), *old.infos.values()):
        node.destroy_publisher(publisher)
    live.camera = scenes.Camera(node, live.world.scene)
    images = live.camera.images.values()
    live.until(lambda: all(p.get_subscription_count() for p in images), "subscriptions")
    restarts, live.next = int(live.value("restarts")), 0
    live.send_until(lambda: int(live.value("restarts")) == restarts + 1, "the new time")
    live.send_until(lambda: live.value("state") == "TRACKING" and live.level == 0, "the track")
    assert_tracking(live)


def test_two_trackers_in_two_namespaces_are_told_apart(
    world: Any, ros_context: Any, peer: Any, tmp_path: Any
) -> None:
    from markerless_tracker.node.tracker.node import TrackerNode

    said = peer.collect(DiagnosticArray, "/diagnostics", output_qos())
    given = {name: str(value) for name, value in world.parameters().items()}
    overrides = [
        Parameter(name, value=value)
        for name, value in {**given, "background_dir": str(tmp_path)}.items()
    ]
    nodes = [
        TrackerNode(
            context=ros_context, parameter_overrides=overrides,
            cli_args=["--ros-args", "-r", f"__ns:=/{side}"],
        )
        for side in ("left", "right")
    ]  # fmt: skip
    for node in nodes:
        peer.executor.add_node(node)
    names = {"left/tracker: tracking", "right/tracker: tracking"}
    try:
        peer.until(lambda: names <= {s.name for m in said for s in m.status}, "both")
        for node, side in zip(nodes, ("left", "right"), strict=True):
            topics = {t for t, _ in peer.node.get_publisher_names_and_types_by_node(
                "tracker", f"/{side}")}  # fmt: skip
            assert {f"/{side}/state", f"/{side}/joint_states"} <= topics
            peer.until(lambda node=node: node.fatal is not None, "what keeps it from tracking")
            assert "nothing for cam01" in str(node.fatal)
    finally:
        for node in nodes:
            peer.executor.remove_node(node)
            node.close()
            node.destroy_node()


# Fuzz

ENCODINGS = st.sampled_from(["bgr8", "rgb8", "mono8", "bgra8", "mono16", "32FC1", "bayer_rggb8"])
SIDES = st.one_of(st.sampled_from([0, 1, 245, 328, 2**31, 2**32 - 1]), st.integers(0, 700))


@st.composite
def damaged(draw: st.DrawFn) -> tuple[str, int, bytes]:
    """A topic of cam02, the distance of a stamp in sets, and a message for it."""
    head = header(0, draw(st.text(max_size=20).filter(lambda t: "\0" not in t)))
    if draw(st.integers(0, 4)) == 0:
        message: Any = CameraInfo(header=head, width=draw(SIDES), height=draw(SIDES))
        numbers = st.floats(width=64)
        message.k = draw(st.lists(numbers, min_size=9, max_size=9))
        message.d = draw(st.lists(numbers, max_size=9))
        message.distortion_model = draw(st.sampled_from(["plumb_bob", "", "equidistant", "x" * 99]))
        topic = "info"
    else:
        message = Image(header=head, width=draw(SIDES), height=draw(SIDES), step=draw(SIDES))
        text = st.text(max_size=200).filter(lambda t: "\0" not in t)
        message.encoding = draw(st.one_of(ENCODINGS, text))
        size = draw(st.sampled_from([0, 1, 100, 245 * 328, 3 * 245 * 328]))
        message.data = array.array("B", bytes(size))
        topic = "image"
    raw = bytearray(serialize_message(message))
    for _ in range(draw(st.integers(0, 3))):
        # Stamps stay, so that a good set is not displaced.
        raw[draw(st.integers(12, min(len(raw), 200) - 1))] = draw(st.integers(0, 255))
    if draw(st.integers(0, 3)) == 0:
        raw = raw[: draw(st.integers(12, len(raw)))]
    return topic, draw(st.integers(-2, 0)), bytes(raw)


def fuzzed(live: Any, messages: list[tuple[str, int, bytes]]) -> None:
    """Send damaged messages, then a good set, which must be tracked."""
    from markerless_tracker.node.ros.cdr import with_stamp

    scene = live.camera.scene
    for topic, sets, raw in messages:
        stamp_ns = scene.stamp_ns(max(0, live.next + sets - 1))
        publishers = live.camera.infos if topic == "info" else live.camera.images
        publishers["cam02"].publish(with_stamp(raw, stamp_ns))
    if any(topic == "info" for topic, *_ in messages):
        live.camera.infos["cam02"].publish(info_of(scene.rig["cam02"], 0))
        # The topics are apart: images may overtake the camera info.
        stamp_ns = scene.stamp_ns(live.next)
        live.send_until(
            lambda: int(live.value("stamp_ns") or 0) >= stamp_ns
            and live.value("iou/cam02") != "nan", "cam02 again",
        )  # fmt: skip
    else:
        live.track()
    assert live.value("state") == "TRACKING"


def log_is_bounded(live: Any, before: int, most: int) -> None:
    added = len(live.process.output) - before
    assert added < most and "Traceback" not in live.process.output, live.process.output[-2000:]


FUZZ = {
    "deadline": None,
    "suppress_health_check": list(HealthCheck),
    "phases": [Phase.generate],
    "database": None,
    "derandomize": True,
}


def test_damaged_messages_between_good_ones(live: Any) -> None:
    live.track()
    before = len(live.process.output)

    @settings(max_examples=6, **FUZZ)
    @given(st.lists(damaged(), min_size=1, max_size=8))
    def check(messages: list[tuple[str, int, bytes]]) -> None:
        fuzzed(live, messages)

    check()
    log_is_bounded(live, before, 60_000)
    assert_tracking(live)


@pytest.mark.long
def test_ten_thousand_damaged_messages(live: Any) -> None:
    live.track()
    before, sent = len(live.process.output), [0]
    threads = len(os.listdir(f"/proc/{live.process.pid}/task"))

    @settings(max_examples=LONG_MESSAGES // 20, **FUZZ)
    @given(st.lists(damaged(), min_size=20, max_size=20))
    def check(messages: list[tuple[str, int, bytes]]) -> None:
        sent[0] += len(messages)
        fuzzed(live, messages)

    check()
    assert sent[0] >= LONG_MESSAGES
    log_is_bounded(live, before, 500_000)
    assert len(os.listdir(f"/proc/{live.process.pid}/task")) <= threads + 1
    assert_tracking(live)
