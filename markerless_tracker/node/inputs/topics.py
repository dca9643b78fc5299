"""Subscriptions to the cameras' topics, as serialised bytes."""

import math
from collections.abc import Callable, Sequence
from typing import Any

from sensor_msgs.msg import CameraInfo, CompressedImage, Image

from markerless_tracker.node.inputs.evidence import EvidenceInput
from markerless_tracker.node.inputs.images import COMPRESSED_SUFFIX, CameraInput
from markerless_tracker.node.ros.qos import FollowingSubscription

POLL_INFOS_S = 0.1
"""Interval at which camera infos are taken: they come with every image and rarely change."""


class CameraTopics:
    """Passes the messages of the cameras' topics to their inputs.

    Args:
        node: creates the subscriptions.
        inputs: of the cameras.
        transport: one of `qos.TRANSPORTS`.
        clock: monotonic time in s.
    """

    def __init__(
        self,
        node: Any,
        inputs: Sequence[CameraInput],
        *,
        transport: str,
        clock: Callable[[], float],
    ) -> None:
        self._clock = clock
        self._polled_s = -math.inf
        self._taking = False
        self._infos = [
            FollowingSubscription(
                node, CameraInfo, source.info_topic, source.on_info_bytes, depth=1, raw=True,
                polled=True,
            )
            for source in inputs
        ]  # fmt: skip
        self._images: list[ImageSubscription | _EvidenceSubscription] = [
            _EvidenceSubscription(node, source, self._before_image)
            if isinstance(source, EvidenceInput)
            else ImageSubscription(node, source, transport, self._before_image, self._after_image)
            for source in inputs
        ]

    def tick(self) -> None:
        """Adapt to the publishers and take camera infos; to be called periodically."""
        for images in self._images:
            images.follow()
        for infos in self._infos:
            infos.follow()
        self._poll_infos()

    def _before_image(self) -> None:
        """Take the camera infos before an image, at most every `POLL_INFOS_S`."""
        if self._clock() - self._polled_s > POLL_INFOS_S:
            self._poll_infos()

    def _after_image(self) -> None:
        """Take the images of the other cameras that have come meanwhile.

        The executor would take one message only, and then wait on all its entities again.
        """
        if self._taking:
            return
        self._taking = True
        try:
            for images in self._images:
                images.take_waiting()
        finally:
            self._taking = False

    def _poll_infos(self) -> None:
        self._polled_s = self._clock()
        for subscription in self._infos:
            subscription.poll()


class _EvidenceSubscription:
    """Receives one camera's silhouettes and, if they are used, its edge maps.

    Args:
        node: creates the subscriptions.
        source: receives the messages.
        before: called before each silhouette.
    """

    def __init__(self, node: Any, source: EvidenceInput, before: Callable[[], None]) -> None:
        def receive(serialised: bytes, info: Any) -> None:
            before()
            source.on_silhouette(serialised, info["publication_sequence_number"])

        takers: dict[str, Callable[..., None]] = {source.image_topic: receive}
        if source.edges_topic is not None:
            takers[source.edges_topic] = source.on_edges
        self._parts = [
            FollowingSubscription(node, CompressedImage, topic, take, raw=True)
            for topic, take in takers.items()
        ]

    def follow(self) -> None:
        """Adapt to the publishers; to be called periodically."""
        for part in self._parts:
            part.follow()

    def take_waiting(self) -> None:
        """Do nothing: evidence is small, and the executor takes both topics."""


class ImageSubscription:
    """Receives one camera's images, raw or compressed.

    Args:
        node: creates the subscription.
        source: receives the messages.
        transport: "auto": raw images, or compressed ones while only those are offered.
        before, after: called before and after each message.
    """

    def __init__(
        self,
        node: Any,
        source: CameraInput,
        transport: str,
        before: Callable[[], None],
        after: Callable[[], None] = lambda: None,
    ) -> None:
        self._node, self._source, self._before, self._after = node, source, before, after
        self._auto = transport == "auto"
        self._compressed = transport == "compressed"
        # After remapping, for the name of compressed images. Raw images are subscribed by the
        # source's own name: creating a subscription remaps it.
        self._topic = node.resolve_topic_name(source.image_topic)
        self._subscription = self._subscribe()

    def follow(self) -> None:
        """Adapt to the publishers; to be called periodically."""
        if self._auto:
            raw = bool(self._node.count_publishers(self._topic))
            offered = raw or self._node.count_publishers(f"{self._topic}{COMPRESSED_SUFFIX}")
            if offered and self._compressed == raw:
                self._compressed = not raw
                self._subscription.close()
                self._subscription = self._subscribe()
                self._node.get_logger().info(
                    f"{self._topic}: {'compressed' if self._compressed else 'raw'} images are "
                    "received"
                )
        self._subscription.follow()

    def take_waiting(self) -> None:
        """Take the queued images."""
        self._subscription.take_waiting()

    def _subscribe(self) -> FollowingSubscription:
        before, after = self._before, self._after
        take = self._source.on_compressed if self._compressed else self._source.on_image

        def receive(serialised: bytes, info: Any) -> None:
            before()
            take(serialised, info["publication_sequence_number"])
            after()

        topic, kind = self._source.image_topic, Image
        if self._compressed:
            topic, kind = f"{self._topic}{COMPRESSED_SUFFIX}", CompressedImage
        return FollowingSubscription(self._node, kind, topic, receive, raw=True)
