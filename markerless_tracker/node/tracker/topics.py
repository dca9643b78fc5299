"""Subscriptions to the cameras' topics, as serialised bytes."""

import math
from collections.abc import Callable, Sequence
from typing import Any

from sensor_msgs.msg import CameraInfo, Image

from markerless_tracker.node.ros.qos import FollowingSubscription
from markerless_tracker.node.tracker.inputs import CameraInput

POLL_INFOS_S = 0.1
"""Time between two looks at the camera infos: they come with every image and rarely change."""


class CameraTopics:
    """Hands the messages of the cameras' topics to their inputs.

    Args:
        node: creates the subscriptions.
        inputs: the cameras'.
        clock: monotonic time in s.
    """

    def __init__(
        self, node: Any, inputs: Sequence[CameraInput], *, clock: Callable[[], float]
    ) -> None:
        self._clock = clock
        self._polled_s = -math.inf
        self._infos = [
            FollowingSubscription(
                node, CameraInfo, source.info_topic, source.on_info_bytes, depth=1, raw=True,
                polled=True,
            )
            for source in inputs
        ]  # fmt: skip
        self._images = [
            FollowingSubscription(node, Image, source.image_topic, self._image(source), raw=True)
            for source in inputs
        ]

    def tick(self) -> None:
        """Adapt to the publishers and take camera infos; to be called periodically."""
        for subscription in (*self._images, *self._infos):
            subscription.follow()
        self._poll_infos()

    def _image(self, source: CameraInput) -> Callable[[bytes, Any], None]:
        """Takes a camera's images, and now and then the camera infos before them."""

        def take(serialised: bytes, info: Any) -> None:
            if self._clock() - self._polled_s > POLL_INFOS_S:
                self._poll_infos()
            source.on_image(serialised, info["publication_sequence_number"])

        return take

    def _poll_infos(self) -> None:
        self._polled_s = self._clock()
        for subscription in self._infos:
            subscription.poll()
