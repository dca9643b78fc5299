"""Cameras' topics, remapped, raw or compressed, over the real middleware."""

from collections.abc import Iterator
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="ROS 2 is not installed")

from rclpy.duration import Duration
from rclpy.node import Node
from sensor_msgs.msg import CameraInfo, CompressedImage, Image

from markerless_tracker.node.inputs.topics import CameraTopics
from markerless_tracker.node.ros.qos import latched_qos, output_qos

REMAPPED = ["cam01/image_raw:=/left/image", "cam01/camera_info:=/left/info"]


class Source:
    """Takes the messages of a camera, as `CameraInput` does."""

    def __init__(self, camera: str = "cam01") -> None:
        self.image_topic, self.info_topic = f"{camera}/image_raw", f"{camera}/camera_info"
        self.got: list[str] = []

    def on_image(self, serialised: bytes, sequence: int) -> None:
        self.got.append("raw")

    def on_compressed(self, serialised: bytes, sequence: int) -> None:
        self.got.append("compressed")

    def on_info_bytes(self, serialised: bytes) -> None:
        self.got.append("info")


@pytest.fixture
def node(ros_context: Any, peer: Any) -> Iterator[Node]:
    arguments = ["--ros-args", *(word for rule in REMAPPED for word in ("-r", rule))]
    node = Node("receiver", context=ros_context, cli_args=arguments)
    peer.executor.add_node(node)
    yield node
    node.destroy_node()


def test_what_is_offered_on_a_remapped_topic_is_received(node: Node, peer: Any) -> None:
    source = Source()
    topics = CameraTopics(node, [source], transport="auto", clock=lambda: 0.0)
    infos = peer.node.create_publisher(CameraInfo, "/left/info", latched_qos())
    infos.publish(CameraInfo())

    def received(publisher: Any, message: Any, kind: str) -> None:
        def found() -> bool:
            topics.tick()
            publisher.publish(message)
            return kind in source.got

        peer.until(found, kind)
        peer.node.destroy_publisher(publisher)

    small = peer.node.create_publisher(CompressedImage, "/left/image/compressed", output_qos())
    received(small, CompressedImage(), "compressed")
    large = peer.node.create_publisher(Image, "/left/image", output_qos())
    received(large, Image(), "raw")
    peer.until(lambda: topics.tick() or "info" in source.got, "the camera info sent before")


def test_exchanged_names_are_exchanged(ros_context: Any, peer: Any) -> None:
    """Each rule is applied once: the name that it gives is another rule's, too."""
    rules = ["cam01/image_raw:=/cam02/image_raw", "cam02/image_raw:=/cam01/image_raw"]
    arguments = ["--ros-args", *(word for rule in rules for word in ("-r", rule))]
    node = Node("receiver", context=ros_context, cli_args=arguments)
    peer.executor.add_node(node)
    first, second = Source("cam01"), Source("cam02")
    topics = CameraTopics(node, [first, second], transport="auto", clock=lambda: 0.0)
    images = peer.node.create_publisher(Image, "/cam01/image_raw", output_qos())
    peer.until(lambda: topics.tick() or images.publish(Image()) or "raw" in second.got, "an image")
    assert "raw" not in first.got
    node.destroy_node()


def test_raw_images_that_are_discovered_later_are_received(node: Node, peer: Any) -> None:
    source = Source()
    topics = CameraTopics(node, [source], transport="auto", clock=lambda: 0.0)
    small = peer.node.create_publisher(CompressedImage, "/left/image/compressed", output_qos())
    peer.until(
        lambda: topics.tick() or small.publish(CompressedImage()) or "compressed" in source.got,
        "compressed images",
    )
    large = peer.node.create_publisher(Image, "/left/image", output_qos())
    peer.until(lambda: topics.tick() or large.publish(Image()) or "raw" in source.got, "raw images")


@pytest.mark.parametrize("transport", ["raw", "compressed"])
def test_a_chosen_transport_is_kept(node: Node, peer: Any, transport: str) -> None:
    source = Source()
    topics = CameraTopics(node, [source], transport=transport, clock=lambda: 0.0)
    publishers = {
        "raw": peer.node.create_publisher(Image, "/left/image", output_qos()),
        "compressed": peer.node.create_publisher(
            CompressedImage, "/left/image/compressed", output_qos()
        ),
    }
    if transport == "raw":
        publishers.pop("raw")
        peer.until(lambda: peer.node.count_publishers("/left/image/compressed"), "a publisher")
    topics.tick()
    subscriptions = {
        kind: peer.node.get_subscriptions_info_by_topic(topic)
        for kind, topic in (("raw", "/left/image"), ("compressed", "/left/image/compressed"))
    }
    assert [kind for kind, found in subscriptions.items() if found] == [transport]


def test_images_that_came_meanwhile_are_taken_with_the_first(node: Node, peer: Any) -> None:
    sources = [Source("cam02"), Source("cam03")]
    topics = CameraTopics(node, sources, transport="raw", clock=lambda: 0.0)
    publishers = [peer.node.create_publisher(Image, s.image_topic, output_qos()) for s in sources]

    def connected() -> bool:
        topics.tick()
        for publisher in publishers:
            publisher.publish(Image())
        return all(source.got for source in sources)

    peer.until(connected, "images of both")
    peer.executor.spin_once(timeout_sec=0.0)
    for source in sources:
        source.got.clear()
    for publisher in publishers:
        publisher.publish(Image())
        assert publisher.wait_for_all_acked(Duration(seconds=60))
    peer.until(lambda: sources[0].got or sources[1].got, "an image")
    assert sources[0].got and sources[1].got
