"""The node `player`: publishes the images of a bag, with their stamps, at the recorded rate."""

import time
from collections.abc import Callable, Iterator
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.duration import Duration
from sensor_msgs.msg import CameraInfo, Image

from markerless_tracker.datasets import FrameSet, Recording, detect_format, open_recording
from markerless_tracker.errors import DatasetError
from markerless_tracker.node.player.pace import Pace
from markerless_tracker.node.player.parameters import (
    PlayerSettings,
    descriptions,
    player_values,
    read_player_settings,
)
from markerless_tracker.node.player.prefetch import prefetch
from markerless_tracker.node.ros.camera_info import info_of
from markerless_tracker.node.ros.declared import GivenNode, declare_effective, given_parameters
from markerless_tracker.node.ros.images import fill_image
from markerless_tracker.node.ros.messages import header, optical_frame
from markerless_tracker.node.ros.qos import image_qos, latched_qos

_PREFETCH_SETS = 8
_REMIND_S = 10.0
_DISCOVERY_S = 1.0
_ACKNOWLEDGE_S = 3.0
# An acknowledged image may not have reached the subscriber's callback yet.
_LINGER_S = 0.5


class PlayerNode(GivenNode):
    """Publishes ``NAME/image_raw`` and ``NAME/camera_info`` of every camera of a bag.

    Args:
        node_arguments: passed on to ``rclpy.node.Node`` (context, parameter_overrides, ...).

    Raises:
        TrackerError: unknown or impossible parameters, or a bag that cannot be read.
    """

    def __init__(self, **node_arguments: Any) -> None:
        super().__init__("player", **node_arguments)
        self.settings = read_player_settings(given_parameters(self))
        declare_effective(self, player_values(self.settings), descriptions())
        self._recording = _open_bag(self.settings)
        self._start = round(self.settings.start_offset * self._recording.fps)
        self._ready = False
        names = self._recording.rig.names
        qos = image_qos()
        self._images = {n: self.create_publisher(Image, f"{n}/image_raw", qos) for n in names}
        self._infos = {n: self.create_publisher(CameraInfo, f"{n}/camera_info", qos) for n in names}
        self.create_subscription(DiagnosticArray, "state", self._on_state, latched_qos())
        self.sets_played = 0

    def waiting_for(self) -> list[str]:
        """What `wait_for_subscribers` waits for, in words; empty when nothing is missing."""
        missing = [
            f"a subscriber of {name}/image_raw"
            for name, publisher in self._images.items()
            if publisher.get_subscription_count() == 0
        ]
        if not self._ready:
            missing.append("`state` to say ready")
        return missing

    def play(self, spin: Callable[[float], bool]) -> None:
        """Play the bag once, or repeatedly if it loops.

        Args:
            spin: lets the node's callbacks run for about that many seconds (0: only those due);
                returns False when it is time to end.

        Raises:
            TrackerError: the bag cannot be read.
        """
        going = self._wait(spin) if self.settings.wait_for_subscribers else self._discover(spin)
        if not going:
            return
        count = self._recording.frame_count
        self.get_logger().info(
            f"playing {self._recording.name}: {'?' if count is None else count} sets of "
            f"{len(self._recording.rig)} cameras at {self.settings.rate:g} x "
            f"{self._recording.fps:g} fps"
        )
        while going:
            going = self._pass(spin) and self.settings.loop
        for warning in self._recording.warnings:
            self.get_logger().warning(warning)

    def finish(self, spin: Callable[[float], bool]) -> None:
        """Wait up to `_ACKNOWLEDGE_S` per topic until subscribers have received the last set."""
        for publisher in (*self._images.values(), *self._infos.values()):
            if publisher.get_subscription_count():
                publisher.wait_for_all_acked(Duration(seconds=_ACKNOWLEDGE_S))
        spin(_LINGER_S)

    def _discover(self, spin: Callable[[float], bool]) -> bool:
        """Wait up to `_DISCOVERY_S` for subscribers: images sent before discovery are lost."""
        until_s = time.monotonic() + _DISCOVERY_S
        while time.monotonic() < until_s:
            if all(publisher.get_subscription_count() for publisher in self._images.values()):
                return True
            if not spin(0.05):
                return False
        return True

    def _wait(self, spin: Callable[[float], bool]) -> bool:
        logged, logged_s = "", 0.0
        while missing := self.waiting_for():
            now_s, text = time.monotonic(), f"waiting for {', '.join(missing)}"
            if text != logged or now_s - logged_s > _REMIND_S:
                self.get_logger().info(text)
                logged, logged_s = text, now_s
            if not spin(0.1):
                return False
        return True

    def _pass(self, spin: Callable[[float], bool]) -> bool:
        """Play once; returns whether to go on."""
        pace = Pace(self.settings.rate, clock=time.monotonic)
        began_s, first_ns, last_ns = time.monotonic(), None, 0
        with prefetch(self._sets, _PREFETCH_SETS) as sets:
            for frame_set in sets:
                first_ns = frame_set.stamp_ns if first_ns is None else first_ns
                last_ns = frame_set.stamp_ns
                messages = self._messages(frame_set)
                if not _sleep(pace.wait_s(frame_set.stamp_ns), spin):
                    return False
                self._publish(messages)
        if first_ns is not None and pace.late_s > 0.0:
            due_s = (last_ns - first_ns) / 1e9 / self.settings.rate
            self.get_logger().warning(
                f"could not keep pace: {time.monotonic() - began_s:.2f} s instead of {due_s:.2f} s "
                f"at rate {self.settings.rate:g}"
            )
        return True

    def _sets(self) -> Iterator[FrameSet]:
        return self._recording.frames(start=self._start)

    def _messages(self, frame_set: FrameSet) -> dict[str, tuple[Image, CameraInfo]]:
        messages = {}
        for camera in self._recording.rig:
            image = Image(header=header(frame_set.stamp_ns, optical_frame(camera.name)))
            fill_image(image, frame_set.images[camera.name], f"{camera.name}/image_raw")
            messages[camera.name] = (image, info_of(camera, frame_set.stamp_ns))
        return messages

    def _publish(self, messages: dict[str, tuple[Image, CameraInfo]]) -> None:
        for name, (image, info) in messages.items():
            self._infos[name].publish(info)
            self._images[name].publish(image)
        self.sets_played += 1

    def _on_state(self, message: DiagnosticArray) -> None:
        values = {pair.key: pair.value for status in message.status for pair in status.values}
        if "ready" in values:
            self._ready = values["ready"] == "true"


def _open_bag(settings: PlayerSettings) -> Recording:
    if not settings.bag.exists():
        raise DatasetError(f"bag: {settings.bag}: no such file or folder")
    if detect_format(settings.bag) != "bag":
        raise DatasetError(
            f"bag: {settings.bag}: no bag, expected a folder with metadata.yaml or a .mcap file "
            "(`markerless_tracker convert` makes one of a recording)"
        )
    return open_recording(settings.bag, format="bag")


def _sleep(seconds: float, spin: Callable[[float], bool]) -> bool:
    """Sleep exactly, serving callbacks now and then; returns False when it is time to end."""
    until_s = time.monotonic() + seconds
    if not spin(0.0):
        return False
    while (left_s := until_s - time.monotonic()) > 0.0:
        # Spinning ends whenever a callback ran; a long wait is cut so that signals are noticed.
        if left_s > 0.1:
            if not spin(0.05):
                return False
        else:
            time.sleep(left_s)
    return True
