"""The node `segmenter`: one camera's images in, their evidence out."""

import array
import time
from dataclasses import replace
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from sensor_msgs.msg import CompressedImage

from markerless_tracker.camera import CameraRig
from markerless_tracker.camera.model import nominal_camera
from markerless_tracker.camera.ros_fields import optical_frame
from markerless_tracker.datasets.background import (
    background_size,
    read_background,
    read_background_models,
)
from markerless_tracker.errors import ConfigError, TrackerError
from markerless_tracker.imaging import BackgroundModel, Segmenter, learn_background, scale_image
from markerless_tracker.node.health import QUIET_S
from markerless_tracker.node.inputs.images import CameraInput
from markerless_tracker.node.inputs.topics import ImageSubscription
from markerless_tracker.node.inputs.wire import (
    EDGES_TOPIC,
    FORMAT,
    SILHOUETTE_TOPIC,
    edges_data,
    settings_digest,
    silhouette_data,
)
from markerless_tracker.node.ros.declared import GivenNode, declare_effective, given_parameters
from markerless_tracker.node.ros.images import decode_received
from markerless_tracker.node.ros.messages import header
from markerless_tracker.node.ros.notices import Notices
from markerless_tracker.node.ros.qos import image_qos
from markerless_tracker.node.segmenter.parameters import (
    SegmenterSettings,
    read_segmenter_settings,
    segmenter_descriptions,
    segmenter_values,
)
from markerless_tracker.node.segmenter.worker import (
    ImageQueue,
    SegmenterStatus,
    SegmentWorker,
    Waiting,
)
from markerless_tracker.observation import Observation

STATE_PERIOD_S = 0.5
EVIDENCE_DEPTH = 10
"""Number of messages of evidence that are kept for a subscriber that has not acknowledged them."""


class SegmenterNode(GivenNode):
    """Receives one camera's images, and publishes the evidence that its worker thread makes.

    It subscribes after compilation, so that a player that waits for subscribers waits for it. Call
    `close` before `destroy_node`.

    Args:
        node_arguments: passed on to ``rclpy.node.Node`` (context, parameter_overrides, ...).

    Raises:
        TrackerError: unknown or impossible parameters, or no usable background.
    """

    def __init__(self, **node_arguments: Any) -> None:
        super().__init__("segmenter", **node_arguments)
        self._settings = settings = read_segmenter_settings(given_parameters(self))
        declare_effective(self, segmenter_values(settings), segmenter_descriptions())
        self._notices = Notices(self._log_warning, time.monotonic)
        self._name = settings.camera
        self._edges = settings.config.edge_weight > 0.0
        self._full_px, background = _background(settings)
        self._segmenter = Segmenter(self._name, background, settings.config, edges=self._edges)
        self._digest = settings_digest(settings.config)
        self._status = SegmenterStatus()
        self._images = ImageQueue()
        topics = [SILHOUETTE_TOPIC, EDGES_TOPIC] if self._edges else [SILHOUETTE_TOPIC]
        self._publishers_of_evidence = [
            self.create_publisher(
                CompressedImage, topic.replace("NAME", self._name), image_qos(depth=EVIDENCE_DEPTH)
            )
            for topic in topics
        ]
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self._worker = SegmentWorker(
            self._images, self._status, observe=self._observe, publish=self._publish,
            report=self._warn,
        )  # fmt: skip
        self._input = CameraInput(
            self._name,
            None,
            self._images,
            self._status,
            report=self._warn,
            clock=time.monotonic,
            channels=lambda _: background.channels,
            image_topic=settings.image_topic,
        )
        self._subscription: ImageSubscription | None = None

    def warm_up(self) -> None:
        """Compile; before `begin`."""
        self.get_logger().info("compiling")
        self._segmenter.warm_up()

    def begin(self) -> None:
        """Receive images."""
        self._worker.start()
        self._subscription = ImageSubscription(
            self, self._input, self._settings.image_transport, lambda: None
        )
        # A steady clock, since simulated time stops without /clock.
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(STATE_PERIOD_S, self._tick, clock=steady)
        self.get_logger().info(
            f"ready: {self._input.image_topic} to {SILHOUETTE_TOPIC.replace('NAME', self._name)}"
            + (f" and {EDGES_TOPIC.replace('NAME', self._name)}" if self._edges else "")
        )

    def close(self) -> None:
        """Stop the worker."""
        self._worker.stop()
        self._notices.flush(last=True)

    def _observe(self, waiting: Waiting) -> Observation:
        message = waiting.message
        if (message.width, message.height) != self._full_px:
            raise ConfigError(
                f"{self._input.image_topic}: an image of {message.width}x{message.height} px came, "
                f"the background of {self._name} is of {self._full_px[0]}x{self._full_px[1]} px"
            )
        image = decode_received(message, self._input.image_topic)
        image = scale_image(image, self._segmenter.background.size_px)
        observation = self._segmenter.observe(image, waiting.stamp_ns)
        return replace(observation, exposure=self._segmenter.gain)

    def _publish(self, observation: Observation) -> int:
        head = header(observation.stamp_ns, optical_frame(self._name))
        parts = [silhouette_data(observation, self._digest)]
        if self._edges:
            parts.append(edges_data(observation, self._digest))
        if self.context.ok():
            for publisher, part in zip(self._publishers_of_evidence, parts, strict=True):
                # rclpy would check other types byte by byte.
                data = array.array("B", part)
                publisher.publish(CompressedImage(header=head, format=FORMAT, data=data))
        return sum(map(len, parts))

    def _tick(self) -> None:
        assert self._subscription is not None
        self._subscription.follow()
        self._notices.flush()
        last_arrival_s = self._images.last_arrival_s
        silent = last_arrival_s is None or time.monotonic() - last_arrival_s > QUIET_S
        level, text = DiagnosticStatus.OK, "segmenting"
        if self._input.refusal:
            level, text = DiagnosticStatus.WARN, self._input.refusal
        elif silent:
            level, text = DiagnosticStatus.STALE, f"no image on {self._input.image_topic}"
        elif self._status.trouble:
            level, text = DiagnosticStatus.WARN, self._status.trouble
        elif self._images.share > 1:
            level = DiagnosticStatus.WARN
            text = f"images come too fast: one of {self._images.share} is segmented"
        values = {
            "camera": self._name,
            "ready": "true",
            "received": str(self._images.received),
            "dropped": str(self._images.dropped),
            "subscribers": str(
                min(p.get_subscription_count() for p in self._publishers_of_evidence)
            ),
            **self._status.values(),
        }
        message = DiagnosticArray()
        message.header.stamp = self.get_clock().now().to_msg()
        message.status = [
            DiagnosticStatus(
                level=level,
                name=f"{self.get_fully_qualified_name().strip('/')}: segmenting",
                message=text,
                hardware_id=self._name,
                values=[KeyValue(key=key, value=value) for key, value in values.items()],
            )
        ]
        self._diagnostics.publish(message)

    def _warn(self, text: str) -> None:
        self._notices.say(text)

    def _log_warning(self, text: str) -> None:
        self.get_logger().warning(text)


def _background(settings: SegmenterSettings) -> tuple[tuple[int, int], BackgroundModel]:
    """Size (width, height) of the received images, and the background scaled for segmentation.

    Raises:
        ConfigError: there is no usable background; names the parameter.
    """
    folder, name = settings.background_dir, settings.camera
    try:
        full_px = background_size(folder, name)
        scaled = CameraRig((nominal_camera(name, settings.scaled_size(full_px)),))
        stored = {name: full_px}
        models = read_background_models(folder, scaled, stored_sizes_px=stored, ignore_others=True)
        if name in models:
            return full_px, models[name]
        frames = read_background(folder, scaled, stored_sizes_px=stored, ignore_others=True)
        return full_px, learn_background(frames[name], settings.config, camera=name)
    except TrackerError as error:
        raise ConfigError(f"background_dir: {error}") from error
