"""One camera's topics: what comes is checked and stored, nothing else."""

from collections.abc import Callable
from typing import Any

from markerless_tracker.camera import CameraModel
from markerless_tracker.errors import ImageError, TrackerError
from markerless_tracker.node.ros.camera_info import check_info
from markerless_tracker.node.ros.images import check_layout
from markerless_tracker.node.ros.stamps import stamp_of
from markerless_tracker.node.tracker.status import TrackerStatus
from markerless_tracker.node.tracker.synchronizer import Synchronizer

PATIENCE_S = 2.0
"""How long a topic may stay silent while others speak before that is reported."""

_GAP_MAX = 1000


class CameraInput:
    """Receives one camera's images and calibration messages.

    Args:
        name: the camera's name.
        camera: its calibration for full-size images, None while unknown.
        sets: gets the images (as messages) that can be used.
        status: told of those that cannot.
        report: called with each new trouble, one line.
        clock: seconds that only go forward.
    """

    def __init__(
        self,
        name: str,
        camera: CameraModel | None,
        sets: Synchronizer[Any],
        status: TrackerStatus,
        *,
        report: Callable[[str], None],
        clock: Callable[[], float],
    ) -> None:
        self.name = name
        self.camera = camera
        self.info: Any = None
        self.image_topic = f"{name}/image_raw"
        self.info_topic = f"{name}/camera_info"
        self._sets = sets
        self._status = status
        self._report = report
        self._clock = clock
        self._first_image_s: float | None = None
        self._disagrees = False
        self._trouble = ""
        self._sequence: int | None = None
        self._info_reported = False
        self._silence_reported = False

    def on_image(self, message: Any, sequence: int | None = None) -> None:
        """Take a sensor_msgs/Image; one that cannot be used is counted and reported.

        Args:
            message: the image.
            sequence: its number at the publisher; gaps are images that the middleware lost.
        """
        now_s = self._clock()
        self._count_lost(sequence)
        if self._first_image_s is None:
            self._first_image_s = now_s
        try:
            check_layout(message, self.image_topic)
            self._check_size(message)
        except ImageError as error:
            self._refuse(str(error))
            return
        if self._disagrees:
            self._status.refused(self.name)
            return
        self._trouble = ""
        self._silence_reported = False
        self._sets.add(self.name, stamp_of(message), message, now_s=now_s)

    def on_info(self, message: Any) -> None:
        """Take a sensor_msgs/CameraInfo; one that contradicts the calibration is reported."""
        self.info = message
        if self.camera is None:
            return
        try:
            check_info(message, self.camera)
            self._disagrees = False
        except TrackerError as error:
            if not self._disagrees:
                self._disagrees = True
                self._say(str(error))

    def missing(self, silent: bool, others_speak: bool, now_s: float) -> list[str]:
        """Topics that are waited for; reports each once when it is due.

        Args:
            silent: whether no usable image has come lately.
            others_speak: whether other cameras' images come.
            now_s: the time.
        """
        topics = []
        if silent:
            topics.append(self.image_topic)
            if others_speak and not self._silence_reported:
                self._silence_reported = True
                self._say(
                    f"{self.image_topic}: no usable image for {PATIENCE_S:g} s while other cameras "
                    "send; no set is complete without it"
                )
        if self.info is None:
            topics.append(self.info_topic)
            due = self._first_image_s is not None and now_s - self._first_image_s > PATIENCE_S
            if due and not self._info_reported:
                self._info_reported = True
                source = "waiting for it" if self.camera is None else "using the calibration file"
                self._say(f"{self.info_topic}: no camera info comes with the images; {source}")
        return topics

    def _count_lost(self, sequence: int | None) -> None:
        before, self._sequence = self._sequence, sequence
        if sequence is not None and before is not None:
            gap = sequence - before - 1
            # Another publisher counts from elsewhere.
            if 0 < gap < _GAP_MAX:
                self._status.lost(self.name, gap)

    def _check_size(self, message: Any) -> None:
        if self.camera is None:
            return
        width, height = self.camera.size_px
        if (message.width, message.height) != (width, height):
            raise ImageError(
                f"{self.image_topic}: an image of {message.width}x{message.height} px came, the "
                f"calibration of {self.name} expects {width}x{height} px"
            )

    def _refuse(self, message: str) -> None:
        self._status.refused(self.name)
        if message != self._trouble:
            self._trouble = message
            self._say(message)

    def _say(self, message: str) -> None:
        self._status.failed(message)
        self._report(message)
