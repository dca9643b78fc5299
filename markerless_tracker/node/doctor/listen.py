"""Receives cameras' images for some seconds."""

import time
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from functools import partial
from typing import Any, NamedTuple

from markerless_tracker.errors import ImageError
from markerless_tracker.imaging import Image
from markerless_tracker.node.ros.process import StopSignals, require_ros, running
from markerless_tracker.node.ros.profile import apply_profile

KEPT = 9
"""Number of images of each camera that are decoded, evenly spaced in time."""
PATIENCE_S = 10.0
"""Longest wait for each camera's first image, or the first topic."""
_TICK_S = 0.25
_SPIN_S = 0.05
_LOOK_S = 3.0
"""Time from the first topic to the end of the search: the discovery of a publisher may take 3 s."""


class Received(NamedTuple):
    """The received images of one camera.

    Attributes:
        topic: of its images.
        stamps_ns, arrivals_s, ages_s: of each image: stamp, arrival by a monotonic clock, time
            from the stamp to the arrival by this machine's clock.
        images: some of the images, decoded.
        refused: number of unusable images.
        trouble: why the last unusable image could not be used; empty if all could.
    """

    topic: str
    stamps_ns: list[int]
    arrivals_s: list[float]
    ages_s: list[float]
    images: list[Image]
    refused: int
    trouble: str


class _Sink:
    """Takes one camera's images and errors from a `CameraInput`."""

    def __init__(self, seconds: float) -> None:
        self._every_s = seconds / KEPT
        self._next_s = 0.0
        self.stamps_ns: list[int] = []
        self.arrivals_s: list[float] = []
        self.ages_s: list[float] = []
        self.kept: deque[Any] = deque(maxlen=KEPT)
        self.count, self.trouble = 0, ""

    def add(self, camera: str, stamp_ns: int, view: Any, *, now_s: float) -> bool:
        """Note an image; keep some of the latest."""
        self.stamps_ns.append(stamp_ns)
        self.arrivals_s.append(now_s)
        self.ages_s.append((time.time_ns() - stamp_ns) / 1e9)
        if now_s >= self._next_s:
            self._next_s = now_s + self._every_s
            self.kept.append(view)
        return True

    def refused(self, camera: str) -> None:
        """Count an unusable image."""
        self.count += 1

    def lost(self, camera: str, images: int) -> None:
        """Ignore lost images, which show in the rate."""

    def failed(self, message: str) -> None:
        """Note an error."""
        self.trouble = message


def image_topics(stop: StopSignals) -> tuple[str, ...]:
    """Names of cameras whose images are offered, raw or compressed, on ``NAME/image_raw``.

    The name is empty for ``/image_raw``.

    Args:
        stop: ends the search earlier.

    Raises:
        RosMissingError: ROS is not installed.
    """
    names: set[str] = set()
    with _own_node() as (node, executor):
        end_s = time.monotonic() + PATIENCE_S
        while time.monotonic() < end_s and not stop.received:
            executor.spin_once(timeout_sec=_SPIN_S)
            for topic, _ in node.get_topic_names_and_types():
                stem = topic.removesuffix("/compressed")
                if stem.endswith("/image_raw") and node.count_publishers(topic):
                    if not names:
                        end_s = time.monotonic() + _LOOK_S
                    names.add(stem.removesuffix("/image_raw").strip("/"))
    return tuple(sorted(names))


def listen(
    cameras: Sequence[str],
    *,
    seconds: float,
    image_topic: str,
    stop: StopSignals,
    progress: Callable[[float], None] = lambda _: None,
) -> dict[str, Received]:
    """Receive the cameras' images.

    Args:
        cameras: their names.
        seconds: duration, from the time at which every camera has sent an image; cameras are waited
            for no longer than `PATIENCE_S`.
        image_topic: topic; NAME stands for the camera.
        stop: ends the reception earlier.
        progress: called with the number of seconds so far.

    Raises:
        RosMissingError: ROS is not installed.
    """
    with _own_node() as (node, executor):
        from markerless_tracker.node.inputs.images import CameraInput
        from markerless_tracker.node.inputs.topics import CameraTopics

        sinks = {name: _Sink(seconds) for name in cameras}
        inputs = [
            CameraInput(
                name, None, sink, sink, report=lambda _: None, clock=time.monotonic,
                image_topic=image_topic,
            )
            for name, sink in sinks.items()
        ]  # fmt: skip
        topics = CameraTopics(node, inputs, transport="auto", clock=time.monotonic)
        begun_s = ticked_s = complete_s = time.monotonic()
        while not stop.received:
            executor.spin_once(timeout_sec=_SPIN_S)
            now_s = time.monotonic()
            silent = any(not (sink.arrivals_s or sink.count) for sink in sinks.values())
            if silent and now_s - begun_s < PATIENCE_S:
                complete_s = now_s
            if now_s - complete_s >= seconds:
                break
            if now_s - ticked_s >= _TICK_S:
                ticked_s = now_s
                topics.tick()
                progress(now_s - begun_s)
        return {entry.name: _received(entry.image_topic, sinks[entry.name]) for entry in inputs}


def _own_node() -> AbstractContextManager[tuple[Any, Any]]:
    """A node and its executor; see `running`."""
    apply_profile()
    require_ros()
    from markerless_tracker.node.ros.declared import GivenNode

    return running(partial(GivenNode, "doctor"))


def _received(topic: str, sink: _Sink) -> Received:
    from markerless_tracker.node.ros.images import decode_received

    images: list[Image] = []
    for message in sink.kept:
        try:
            image = decode_received(message, topic)
        except ImageError as error:
            sink.refused(topic)
            sink.failed(str(error))
            continue
        if not images or image.shape == images[-1].shape:
            images.append(image)
    return Received(
        topic, sink.stamps_ns, sink.arrivals_s, sink.ages_s, images, sink.count, sink.trouble
    )
