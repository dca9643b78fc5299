"""The node `player`: publishes the images of a bag, with their stamps, at the recorded rate."""

import time
from collections.abc import Iterator, Sequence
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.duration import Duration
from sensor_msgs.msg import CameraInfo, Image

from markerless_tracker.datasets import detect_format
from markerless_tracker.datasets.bag.recording import BagRecording
from markerless_tracker.datasets.part import PartRecording
from markerless_tracker.errors import DatasetError
from markerless_tracker.node.player.clock import BagClock
from markerless_tracker.node.player.control import Control
from markerless_tracker.node.player.encode import PlayedSet, played_sets
from markerless_tracker.node.player.lockstep import Lockstep
from markerless_tracker.node.player.others import END_NS, OtherTopics
from markerless_tracker.node.player.pace import Pace
from markerless_tracker.node.player.parameters import (
    PlayerSettings,
    descriptions,
    player_values,
    read_player_settings,
)
from markerless_tracker.node.player.prefetch import prefetch
from markerless_tracker.node.player.spin import Spin
from markerless_tracker.node.ros.declared import GivenNode, declare_effective, given_parameters
from markerless_tracker.node.ros.qos import image_qos, latched_qos

_PREFETCH_SETS = 8
_REMIND_S = 10.0
_DISCOVERY_S = 1.0
_SERVE_S = 0.1
"""Interval at which due callbacks run, such as requests for parameters."""
_PATIENCE_S = 5.0
"""Time for the discovery of a tracker in lockstep."""
_ACKNOWLEDGE_S, _SLICE_S = 10.0, 0.1
_LATE_S = 0.05
"""Least delay of the last set that is reported."""
# An acknowledged image may not have reached the subscriber's callback yet.
_LINGER_S = 0.5


class PlayerNode(GivenNode):
    """Publishes ``NAME/image_raw`` and ``NAME/camera_info`` of every camera of a bag.

    By its parameters it publishes a selection of topics, other topics of the bag, and `/clock`. Its
    services are those of `Control`.

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
        self._start = _first_set(self._recording, self.settings.start_offset)
        self._ready = False
        self._lockstep = Lockstep(self.settings.lockstep_timeout, clock=time.monotonic)
        self._served_s = time.monotonic()
        images, infos, others = _choice(self._recording, self.settings.topics)
        qos = image_qos()
        self._images = {n: self.create_publisher(Image, f"{n}/image_raw", qos) for n in images}
        self._infos = {n: self.create_publisher(CameraInfo, f"{n}/camera_info", qos) for n in infos}
        self._others = OtherTopics(self, self._recording, others)
        self._control = Control(self, paused=self.settings.paused)
        self._clock = BagClock(self, self.settings.clock, self.settings.rate)
        self._states: Any = self.create_subscription(
            DiagnosticArray, "state", self._on_state, latched_qos()
        )
        self.sets_played = 0
        self.playing_s = self.cpu_s = 0.0

    def waiting_for(self) -> list[str]:
        """Descriptions of what `wait_for_subscribers` waits for; empty when nothing is missing."""
        missing = [
            f"a subscriber of {name}/image_raw"
            for name, publisher in self._images.items()
            if publisher.get_subscription_count() == 0
        ]
        if not self._ready:
            missing.append("`state` to say ready")
        return missing

    def play(self, spin: Spin) -> None:
        """Play the bag once, or repeatedly if it loops.

        Args:
            spin: lets the node's callbacks run.

        Raises:
            TrackerError: the bag cannot be read.
        """
        going = self._wait(spin) if self.settings.wait_for_subscribers else self._discover(spin)
        if not going:
            return
        if not self.settings.lockstep:
            # Every result comes with a state, whose decoding would take time.
            self.destroy_subscription(self._states)
        count = self._recording.frame_count
        pace = f"at {self.settings.rate:g} x {self._recording.fps:g} fps"
        self.get_logger().info(
            f"playing {self._recording.name}: {'?' if count is None else count} sets of "
            f"{len(self._recording.rig)} cameras {'in lockstep' if self._in_step else pace}"
        )
        if self.settings.lockstep and not self._in_step:
            self.get_logger().warning(f"no tracker's `state` says ready; playing {pace}")
        began_s, began_cpu_s = time.monotonic(), time.process_time()
        while going:
            going = self._pass(spin) and self.settings.loop
        self.playing_s = time.monotonic() - began_s
        self.cpu_s = time.process_time() - began_cpu_s
        for warning in self._recording.warnings:
            self.get_logger().warning(warning)

    def finish(self, spin: Spin) -> None:
        """Wait up to `_ACKNOWLEDGE_S` until subscribers have received the last set."""
        end_s = time.monotonic() + _ACKNOWLEDGE_S
        for publisher in (*self._images.values(), *self._infos.values()):
            while publisher.get_subscription_count() and time.monotonic() < end_s:
                if publisher.wait_for_all_acked(Duration(seconds=_SLICE_S)):
                    break
                if not spin(0.0):
                    return
        spin(_LINGER_S)

    @property
    def _in_step(self) -> bool:
        return self.settings.lockstep and not self._lockstep.alone

    def _discover(self, spin: Spin) -> bool:
        """Wait for subscribers, or in lockstep for a tracker, since earlier images are lost."""
        lockstep = self.settings.lockstep
        until_s = time.monotonic() + (_PATIENCE_S if lockstep else _DISCOVERY_S)
        while time.monotonic() < until_s:
            heard = all(publisher.get_subscription_count() for publisher in self._images.values())
            if heard and (self._in_step or not lockstep):
                return True
            if not spin(0.05):
                return False
        return True

    def _wait(self, spin: Spin) -> bool:
        logged, logged_s = "", 0.0
        while missing := self.waiting_for():
            now_s, text = time.monotonic(), f"waiting for {', '.join(missing)}"
            if text != logged or now_s - logged_s > _REMIND_S:
                self.get_logger().info(text)
                logged, logged_s = text, now_s
            if not spin(0.1):
                return False
        return True

    def _pass(self, spin: Spin) -> bool:
        """Play once; returns whether to continue."""
        pace = Pace(self.settings.rate, clock=time.monotonic)
        self._others_up_to = self._others.up_to(later=self._start > 0)
        try:
            return self._send_all(pace, spin)
        finally:
            # Also if the pass ended early.
            if (lost_s := pace.shifted_s + pace.late_s) > _LATE_S:
                self.get_logger().warning(
                    f"could not keep pace: the last set was sent {lost_s:.2f} s late at rate "
                    f"{self.settings.rate:g}"
                )

    def _send_all(self, pace: Pace, spin: Spin) -> bool:
        """Send the sets at their times; returns whether to continue."""
        with prefetch(self._sets, _PREFETCH_SETS) as sets:
            for played in sets:
                wait_s = 0.0 if self._in_step else pace.wait_s(played.stamp_ns)
                if not self._sleep(wait_s, played.stamp_ns, spin):
                    return False
                if (held_s := self._control.hold(spin)) is None:
                    return False
                pace.held(held_s)
                self._publish(played)
                if not self._until_dealt_with(played.stamp_ns, spin):
                    return False
        self._others.publish(self._others_up_to(END_NS, END_NS))
        return True

    def _sets(self) -> Iterator[PlayedSet]:
        wanted = {*self._images, *self._infos}
        return played_sets(self._recording, self._start, wanted, self._others_up_to)

    def _publish(self, played: PlayedSet) -> None:
        self._clock.publish(played.stamp_ns)
        self._others.publish(played.others)
        for name, (info, image) in played.messages.items():
            if name in self._infos:
                self._infos[name].publish(info)
            if name in self._images:
                self._images[name].publish(image)
        self.sets_played += 1

    def _until_dealt_with(self, stamp_ns: int, spin: Spin) -> bool:
        """In lockstep, wait until trackers have processed a set; returns whether to continue."""
        if not self._in_step:
            return True
        self._lockstep.sent(stamp_ns)
        while self._lockstep.waiting_for():
            if not spin(_SERVE_S, lambda: not self._lockstep.waiting_for()):
                return False
            if late := self._lockstep.overdue():
                self.get_logger().warning(
                    f"stamp {stamp_ns}: not dealt with by {', '.join(late)} in "
                    f"{self.settings.lockstep_timeout:g} s (lockstep_timeout); not waited for "
                    "until another set is"
                )
        return True

    def _sleep(self, seconds: float, next_ns: int, spin: Spin) -> bool:
        """Sleep until a set is due, serving callbacks at intervals; False when it is time to end.

        Args:
            seconds: until the set.
            next_ns: its stamp.
            spin: as in `play`.
        """
        until_s = time.monotonic() + seconds
        while True:
            now_s = time.monotonic()
            if now_s - self._served_s > _SERVE_S:
                self._served_s = now_s
                if not spin(0.0):
                    return False
            left_s = until_s - time.monotonic()
            if left_s <= 0.0:
                return True
            time.sleep(min(left_s, _SERVE_S, self._clock.tick(next_ns, left_s)))

    def _on_state(self, message: DiagnosticArray) -> None:
        for status in message.status:
            values = {pair.key: pair.value for pair in status.values}
            self._lockstep.update(status.name, values)
            if "ready" in values:
                self._ready = values["ready"] == "true"


def _choice(
    recording: BagRecording, topics: Sequence[str] | None
) -> tuple[list[str], list[str], list[str]]:
    """Cameras whose images are played, cameras whose infos are played, names of other topics."""
    names = recording.rig.names
    if topics is None:
        return list(names), list(names), []
    images = {f"/{name}/image_raw": name for name in names}
    infos = {f"/{name}/camera_info": name for name in names}
    return (
        [images[topic] for topic in topics if topic in images],
        [infos[topic] for topic in topics if topic in infos],
        [topic for topic in topics if topic not in images and topic not in infos],
    )


def _first_set(recording: BagRecording, start_offset_s: float) -> int:
    """Index of the set so many seconds after the first one.

    Raises:
        DatasetError: the bag ends before; names the parameter.
    """
    if start_offset_s == 0.0:
        return 0
    try:
        return PartRecording(recording, from_s=start_offset_s).first
    except DatasetError as error:
        raise DatasetError(f"start_offset: {error}") from error


def _open_bag(settings: PlayerSettings) -> BagRecording:
    if not settings.bag.exists():
        raise DatasetError(f"bag: {settings.bag}: no such file or folder")
    if detect_format(settings.bag) != "bag":
        raise DatasetError(
            f"bag: {settings.bag}: no bag, expected a folder with metadata.yaml or a .mcap file "
            "(`markerless_tracker convert` makes one of a recording)"
        )
    # Checksums would take a quarter of the player's time; other commands verify them.
    return BagRecording(settings.bag, checked=False)
