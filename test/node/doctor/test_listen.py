"""How long cameras are searched for and listened to."""

from collections.abc import Iterator
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="ROS 2 is not installed")

from sensor_msgs.msg import Image

from markerless_tracker.node.doctor import listen as listening
from markerless_tracker.node.ros.images import fill_image
from markerless_tracker.node.ros.qos import image_qos

GOES_ON: Any = SimpleNamespace(received=False)


class LateGraph:
    """A graph whose topics are discovered one after another, on a clock of its own.

    Args:
        topics: time of the discovery of each, in s.
    """

    def __init__(self, topics: dict[str, float]) -> None:
        self._topics, self.now_s = topics, 0.0

    def monotonic(self) -> float:
        return self.now_s

    def spin_once(self, *, timeout_sec: float) -> None:
        self.now_s += timeout_sec

    def get_topic_names_and_types(self) -> list[tuple[str, list[str]]]:
        return [(name, []) for name, at_s in self._topics.items() if at_s <= self.now_s]

    def count_publishers(self, topic: str) -> int:
        return 1

    @contextmanager
    def own_node(self) -> Iterator[tuple[Any, Any]]:
        yield self, self


@pytest.mark.parametrize(
    ("topics", "expected"),
    [
        ({"/cam01/image_raw": 0.1, "/rig/cam02/image_raw/compressed": 2.9}, ("cam01", "rig/cam02")),
        ({"/image_raw": 0.1, "/cam01/image_raw": 1.0}, ("", "cam01")),
        ({"/cam01/image_raw": 9.0, "/cam01/image": 1.0}, ("cam01",)),
        ({"/cam01/image": 1.0}, ()),
    ],
)
def test_cameras_are_found_as_long_as_discovery_takes(
    monkeypatch: pytest.MonkeyPatch, topics: dict[str, float], expected: tuple[str, ...]
) -> None:
    graph = LateGraph(topics)
    monkeypatch.setattr(listening, "time", graph)
    monkeypatch.setattr(listening, "_own_node", graph.own_node)
    assert listening.image_topics(GOES_ON) == expected


def test_the_time_runs_from_the_first_image_of_the_last_camera(
    monkeypatch: pytest.MonkeyPatch, peer: Any
) -> None:
    monkeypatch.setattr(listening, "PATIENCE_S", 60.0)
    names = ("cam01", "cam02")
    publishers = [
        peer.node.create_publisher(Image, f"{name}/image_raw", image_qos()) for name in names
    ]
    message = fill_image(Image(), np.full((48, 64, 3), 90, np.uint8), "cam")

    def send(elapsed_s: float) -> None:
        for publisher in publishers[: 2 if elapsed_s > 2.0 else 1]:
            publisher.publish(message)

    heard = listening.listen(
        names, seconds=0.5, image_topic="NAME/image_raw", stop=GOES_ON, progress=send
    )
    assert heard["cam02"].arrivals_s


def test_a_wait_for_another_camera_does_not_fill_the_memory() -> None:
    sink = listening._Sink(1.0)
    for number in range(100):
        sink.add("cam01", number, number, now_s=0.1 * number)
    assert len(sink.stamps_ns) == 100
    assert len(sink.kept) == listening.KEPT and sink.kept[-1] >= 98
