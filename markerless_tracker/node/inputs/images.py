"""Inputs of one camera: messages are checked and stored, pixels are not read."""

from collections.abc import Callable
from typing import Any, Protocol

from rclpy.serialization import deserialize_message
from sensor_msgs.msg import CameraInfo

from markerless_tracker.camera import CameraModel
from markerless_tracker.errors import ImageError, TrackerError
from markerless_tracker.node.health import QUIET_S
from markerless_tracker.node.ros.camera_info import FIRST_INFO, check_info
from markerless_tracker.node.ros.cdr import (
    CompressedMessage,
    ImageMessage,
    read_compressed,
    read_image,
    without_stamp,
)
from markerless_tracker.node.ros.images import check_layout, received_channels

COMPRESSED_SUFFIX = "/compressed"
"""Suffix of the topic of compressed images after that of raw images."""
_GAP_MAX = 1000
_SHOWN = 80
"""Largest number of characters of a received text in a message."""
_KINDS = {1: "grey", 3: "colour"}


class TakesViews(Protocol):
    """Receiver of usable images: a `Synchronizer`, or the segmenter's queue."""

    def add(self, camera: str, stamp_ns: int, view: Any, *, now_s: float) -> bool:
        """Store one view; never blocks."""


class CountsImages(Protocol):
    """Receiver of counts and errors: a `TrackerStatus`, or the segmenter's."""

    def refused(self, camera: str) -> None:
        """Count an unusable image."""

    def lost(self, camera: str, images: int) -> None:
        """Count images that were sent and not received."""

    def failed(self, message: str) -> None:
        """Record an error."""


class CameraInput:
    """Receives one camera's images and camera infos.

    An unusable image is dropped. A camera without usable images is left out of the sets (see
    `Synchronizer`).

    Args:
        name: the camera's name.
        camera: its calibration for full-size images, None while unknown.
        sets: receives the usable images (as `ImageMessage` or `CompressedMessage`).
        status: receives the counts and errors.
        report: called with one line for each unusable image, and when a problem begins or ends.
        clock: monotonic time in s.
        channels: number of channels of the camera's background; None if there is none to match.
        image_topic, info_topic: topics; ``NAME`` stands for the camera.
        offset_ns: time by which its stamps are late.

    Attributes:
        image_topic, info_topic: of the camera.
    """

    _what = "an image"

    def __init__(
        self,
        name: str,
        camera: CameraModel | None,
        sets: TakesViews,
        status: CountsImages,
        *,
        report: Callable[[str], None],
        clock: Callable[[], float],
        channels: Callable[[str], int | None] = lambda _: None,
        image_topic: str = "NAME/image_raw",
        info_topic: str = "NAME/camera_info",
        offset_ns: int = 0,
    ) -> None:
        self.name = name
        self.camera = camera
        self.info: Any = None
        self.image_topic = image_topic.replace("NAME", name)
        self.info_topic = info_topic.replace("NAME", name)
        self._sets, self._offset_ns = sets, offset_ns
        self._status = status
        self._report = report
        self._clock = clock
        self._channels = channels
        self._first_image_s: float | None = None
        self._info_refusal = ""
        self._info_note = ""
        self._refusal = ""
        self._refused_s = 0.0
        self._sequence: int | None = None
        self._rising = True
        self._info_bytes = b""
        self._reference = "the calibration file" if camera is not None else FIRST_INFO
        self._info_reported = False
        self._silent_since_s: float | None = None

    @property
    def refusal(self) -> str:
        """Reason why the last image could not be used; empty if it was usable or is old."""
        return self._refusal if self._clock() - self._refused_s < QUIET_S else ""

    def on_image(self, serialised: bytes, sequence: int | None = None) -> None:
        """Store a sensor_msgs/Image; an unusable one is counted and reported.

        Args:
            serialised: the message's bytes; the stored image shares them.
            sequence: its number at the publisher; gaps are images lost by the middleware.
        """
        self._take(serialised, sequence, read_image, self.image_topic)

    def on_compressed(self, serialised: bytes, sequence: int | None = None) -> None:
        """As `on_image`, for a sensor_msgs/CompressedImage."""
        topic = f"{self.image_topic}{COMPRESSED_SUFFIX}"
        self._take(serialised, sequence, read_compressed, topic)

    def _take(
        self,
        serialised: bytes,
        sequence: int | None,
        read: Callable[[bytes, str], Any],
        topic: str,
    ) -> None:
        now_s = self._clock()
        self._count_lost(sequence)
        if self._first_image_s is None:
            self._first_image_s = now_s
        try:
            message = read(serialised, topic)
            self._check(message, topic)
        except ImageError as error:
            self._refuse(str(error), now_s)
            return
        self._refusal = ""
        if self._silent_since_s is not None:
            self._report(
                f"{self.image_topic}: usable images again after "
                f"{now_s - self._silent_since_s:.1f} s"
            )
            self._silent_since_s = None
        self._store(message, now_s)

    def _refuse(self, reason: str, now_s: float) -> None:
        """Count and report an unusable message."""
        self._status.refused(self.name)
        self._refused_s, self._refusal = now_s, reason
        self._say(reason)

    def _store(self, message: Any, now_s: float) -> None:
        self._sets.add(self.name, message.stamp_ns - self._offset_ns, message, now_s=now_s)

    def on_info_bytes(self, serialised: bytes) -> None:
        """Take a serialised sensor_msgs/CameraInfo, if its content differs from the last one."""
        content = without_stamp(serialised)
        if content == self._info_bytes:
            return
        self._info_bytes = content
        try:
            message = deserialize_message(serialised, CameraInfo)
        except Exception as error:  # rclpy has no common base class for damaged messages
            self._say(
                f"{self.info_topic}: a message of {len(serialised)} bytes cannot be read "
                f"({type(error).__name__})"
            )
            return
        self.on_info(message)

    def on_info(self, message: CameraInfo) -> None:
        """Compare a sensor_msgs/CameraInfo with the calibration; differences are reported."""
        self.info = message
        if self.camera is None:
            return
        try:
            note, refusal = check_info(message, self.camera, self.info_topic, self._reference), ""
        except TrackerError as error:
            note, refusal = "", str(error)
        if refusal and refusal != self._info_refusal:
            self._say(refusal)
        if note and note != self._info_note:
            self._report(note)
        if self._info_refusal and not refusal:
            self._report(f"{self.info_topic}: agrees with {self._reference} again")
        self._info_refusal, self._info_note = refusal, note

    def missing(self, silent: bool, left_out: bool, others_send: bool, now_s: float) -> list[str]:
        """Topics without messages; each is reported once.

        Args:
            silent: whether no usable image was received for `QUIET_S`.
            left_out: whether sets are complete without this camera.
            others_send: whether images of other cameras are received.
            now_s: the time.
        """
        topics = []
        if silent:
            topics.append(self.image_topic)
            if others_send and left_out and self._silent_since_s is None:
                self._silent_since_s = now_s - QUIET_S
                self._say(
                    f"{self.image_topic}: no usable image for {QUIET_S:g} s while other cameras "
                    f"send; {self.name} is left out until one comes"
                )
        if self.info is None:
            topics.append(self.info_topic)
            due = self._first_image_s is not None and now_s - self._first_image_s > QUIET_S
            if due and not self._info_reported:
                self._info_reported = True
                source = "waiting for it" if self.camera is None else "using the calibration file"
                self._say(f"{self.info_topic}: no camera info comes with the images; {source}")
        return topics

    def _check(self, message: Any, topic: str) -> None:
        if isinstance(message, ImageMessage):
            check_layout(message, topic)
        if self._info_refusal:
            raise ImageError(self._info_refusal)
        if self.camera is not None:
            width, height = self._expected_size_px(self.camera)
            if (message.width, message.height) != (width, height):
                raise ImageError(
                    f"{topic}: {self._what} of {message.width}x{message.height} px came, "
                    f"the calibration of {self.name} expects {width}x{height} px"
                )
        self._check_kind(message, topic)

    def _expected_size_px(self, camera: CameraModel) -> tuple[int, int]:
        return camera.size_px

    def _check_kind(self, message: ImageMessage | CompressedMessage, topic: str) -> None:
        expected, came = self._channels(self.name), received_channels(message)
        if expected is not None and came != expected:
            kind = message.encoding if isinstance(message, ImageMessage) else message.format
            raise ImageError(
                f"{topic}: a {_KINDS[came]} image ({kind[:_SHOWN]}) came, the "
                f"background of {self.name} is {_KINDS[expected]}"
            )

    def _count_lost(self, sequence: int | None) -> None:
        before, self._sequence = self._sequence, sequence
        if sequence is not None and before is not None:
            gap = sequence - before - 1
            # A restarted publisher counts from the beginning. Numbers of two publishers alternate.
            if self._rising and 0 < gap < _GAP_MAX:
                self._status.lost(self.name, gap)
            self._rising = sequence > before

    def _say(self, message: str) -> None:
        self._status.failed(message)
        self._report(message)
