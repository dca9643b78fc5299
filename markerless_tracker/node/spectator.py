"""Receives the outputs of a running tracker, for a viewer in another process."""

import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseArray
from sensor_msgs.msg import Image as ImageMessage
from sensor_msgs.msg import JointState

from markerless_tracker.errors import ConfigError, ImageError
from markerless_tracker.geometry import FloatArray
from markerless_tracker.imaging import Image
from markerless_tracker.node.ros.declared import check_topics
from markerless_tracker.node.ros.images import decode_image
from markerless_tracker.node.ros.process import Listener
from markerless_tracker.node.ros.qos import image_qos, latched_qos, output_qos
from markerless_tracker.node.ros.stamps import stamp_of

_WAIT_S = 0.1
_OVERLAP = "iou/"
"""Prefix of the keys of `state` with a camera's overlap; the camera's name follows."""


@dataclass(frozen=True, eq=False, kw_only=True)
class TrackerMessage:
    """The contents of one message; attributes of other topics are empty.

    Attributes:
        stamp_ns: time of the images.
        markers_m: (15, 3) of `marker_poses`, m, world frame.
        angles_rad: joint -> angle, of `joint_states`.
        state: SEARCHING, TRACKING or LOST, of `state`.
        overlap: camera -> overlap of silhouette and body, of `state`.
        pictures: camera -> image (h, w, 3) BGR with the body, of `debug/NAME/overlay`.
    """

    stamp_ns: int
    markers_m: FloatArray | None = None
    angles_rad: Mapping[str, float] = field(default_factory=dict)
    state: str = ""
    overlap: Mapping[str, float] = field(default_factory=dict)
    pictures: Mapping[str, Image] = field(default_factory=dict)


class Spectator(Listener):
    """Subscribes to a tracker's outputs; a context manager.

    The cameras are those of `state`. The tracker draws their overlays while they have subscribers.
    """

    def __init__(self) -> None:
        super().__init__("spectator")
        self._received: deque[TrackerMessage] = deque()
        self._overlays: dict[str, Any] = {}

    def _subscribe_all(self) -> None:
        create = self._node.create_subscription
        create(DiagnosticArray, "state", self._on_state, latched_qos())
        create(PoseArray, "marker_poses", self._on_markers, output_qos())
        create(JointState, "joint_states", self._on_angles, output_qos())

    @property
    def cameras(self) -> tuple[str, ...]:
        """Names of the tracker's cameras, in its order; empty until `state` was received."""
        return tuple(self._overlays)

    def listen(
        self, *, until: Callable[[], bool], seconds: float | None = None
    ) -> Iterator[TrackerMessage | None]:
        """The messages as they come; None at intervals while no message comes.

        Args:
            until: ends the iteration when it returns True.
            seconds: longest duration; None = unlimited.
        """
        end_s = None if seconds is None else time.monotonic() + seconds
        while not until() and (end_s is None or time.monotonic() < end_s):
            self._executor.spin_once(timeout_sec=_WAIT_S)
            if not self._received:
                yield None
            while self._received:
                yield self._received.popleft()

    def _on_state(self, message: Any) -> None:
        values = {pair.key: pair.value for status in message.status for pair in status.values}
        try:
            overlap = {
                key.removeprefix(_OVERLAP): float(value)
                for key, value in values.items()
                if key.startswith(_OVERLAP)
            }
            check_topics("state", "debug/NAME/overlay", overlap)
        except (ValueError, ConfigError):
            return  # It is no tracker's.
        for name in overlap:
            if name not in self._overlays:
                self._overlays[name] = self._subscribe(name)
        self._received.append(
            TrackerMessage(
                stamp_ns=stamp_of(message),
                state=values.get("state", ""),
                overlap={name: value for name, value in overlap.items() if np.isfinite(value)},
            )
        )

    def _subscribe(self, camera: str) -> Any:
        topic = f"debug/{camera}/overlay"

        def take(message: Any) -> None:
            try:
                picture = decode_image(message, topic)
            except ImageError as error:
                self._node.get_logger().warning(str(error))
                return
            self._received.append(
                TrackerMessage(stamp_ns=stamp_of(message), pictures={camera: picture})
            )

        return self._node.create_subscription(ImageMessage, topic, take, image_qos(depth=2))

    def _on_markers(self, message: Any) -> None:
        places = [pose.position for pose in message.poses]
        markers = np.array([(p.x, p.y, p.z) for p in places]).reshape(-1, 3)
        self._received.append(TrackerMessage(stamp_ns=stamp_of(message), markers_m=markers))

    def _on_angles(self, message: Any) -> None:
        angles = dict(zip(message.name, message.position, strict=False))
        self._received.append(TrackerMessage(stamp_ns=stamp_of(message), angles_rad=angles))
