"""The node `tracker`: four image topics in, one person's pose out."""

import time
from collections.abc import Callable, Generator, Sequence
from functools import partial
from threading import Lock
from types import coroutine
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseArray, PoseWithCovarianceStamped
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.node import Node
from sensor_msgs.msg import CameraInfo, Image, JointState
from std_msgs.msg import String
from std_srvs.srv import Trigger
from visualization_msgs.msg import MarkerArray

from markerless_tracker.body import BodyModel
from markerless_tracker.body.urdf import urdf
from markerless_tracker.camera import CameraRig
from markerless_tracker.imaging import scale_image
from markerless_tracker.node.ros import messages
from markerless_tracker.node.ros.declared import declare_effective, given_parameters
from markerless_tracker.node.ros.images import decode_image
from markerless_tracker.node.ros.qos import image_qos, latched_qos, output_qos
from markerless_tracker.node.tracker import parameters
from markerless_tracker.node.tracker.inputs import PATIENCE_S, CameraInput
from markerless_tracker.node.tracker.learning import Learning
from markerless_tracker.node.tracker.outputs import Pictures, ResultFile
from markerless_tracker.node.tracker.setup import RigSource, build
from markerless_tracker.node.tracker.status import TrackerStatus
from markerless_tracker.node.tracker.synchronizer import Synchronizer
from markerless_tracker.node.tracker.worker import TrackedSet, TrackerHandle, TrackWorker
from markerless_tracker.tracking import TrackerConfig

STATE_PERIOD_S = 0.5
_TURN_S = 0.002

_NOTED = (
    "tracked",
    "skipped",
    "incomplete",
    "dropped_before_ready",
    "dropped_before_start",
    "dropped_while_learning",
    "dropped_on_error",
    "latency_median_ms",
    "latency_p95_ms",
    "fps",
)


class TrackerNode(Node):
    """Subscribes, stores, and publishes what its worker thread finds.

    Callbacks only store; `TrackWorker` does the work. Call `close` before `destroy_node`.

    Args:
        node_arguments: passed on to ``rclpy.node.Node`` (context, parameter_overrides, ...).

    Raises:
        TrackerError: unknown or impossible parameters, or files that cannot be used.
    """

    def __init__(self, **node_arguments: Any) -> None:
        super().__init__(
            "tracker", automatically_declare_parameters_from_overrides=True, **node_arguments
        )
        self._settings = parameters.read_settings(given_parameters(self))
        declare_effective(
            self,
            parameters.effective_values(self._settings),
            parameters.descriptions(),
            TrackerConfig.settings(),
        )
        self._seconds: Callable[[], float] = time.monotonic
        self._source = RigSource(self._settings)
        names = self._source.names
        tolerance_ns = round(self._settings.sync_tolerance * 1e9)
        self._status = TrackerStatus()
        self._sets: Synchronizer[Image] = Synchronizer(names, tolerance_ns=tolerance_ns)
        self._inputs = [self._input(name) for name in names]
        self._fitting: TrackerHandle | None = None
        self._described: BodyModel | None = None
        self._no_pose_shown = False
        self._missing: Sequence[str] = ()
        self._state_lock = Lock()
        self._result_file = ResultFile(self._settings.result_file)
        self._create_publishers()
        # With a calibration file all mistakes come to light before anything is started.
        if self._source.rig is not None:
            self._build(self._source.rig)
        self._listen()
        self._worker = TrackWorker(
            self._sets,
            self._status,
            prepare=self._prepare,
            publish=self._publish,
            report=self._warn,
            clock=self._seconds,
        )
        self._worker.start()

    @property
    def fatal(self) -> str | None:
        """Why the tracker cannot work at all, None while it can."""
        return self._worker.fatal

    @property
    def status(self) -> TrackerStatus:
        """Counts and times."""
        return self._status

    def close(self, timeout_s: float = 5.0) -> bool:
        """Stop the worker and complete the result files; returns whether the worker ended."""
        ended = self._worker.stop(timeout_s)
        counts = self._status.values(self._sets.counts, (), ())
        self._result_file.close({"node": {key: counts[key] for key in _NOTED}})
        return ended

    # inputs

    def _input(self, name: str) -> CameraInput:
        camera = None if self._source.rig is None else self._source.rig[name]
        return CameraInput(
            name, camera, self._sets, self._status, report=self._warn, clock=self._seconds
        )

    def _listen(self) -> None:
        self._image_subscriptions: dict[str, Any] = {}
        for source in self._inputs:
            self._listen_to(source, reliable=True)
            self.create_subscription(
                CameraInfo, source.info_topic, source.on_info, image_qos(depth=1)
            )
        self._source.listen(self)
        self.create_service(Trigger, "~/reset", self._on_reset)
        # Images have to come in while this one is being answered.
        self.create_service(
            Trigger,
            "~/learn_background",
            self._on_learn,
            callback_group=ReentrantCallbackGroup(),
        )
        self.create_timer(STATE_PERIOD_S, self._tick)

    def _listen_to(self, source: CameraInput, *, reliable: bool) -> None:
        old = self._image_subscriptions.pop(source.name, None)
        if old is not None:
            self.destroy_subscription(old)

        def take(message: Image, info: Any) -> None:
            source.on_image(message, info["publication_sequence_number"])

        self._image_subscriptions[source.name] = self.create_subscription(
            Image, source.image_topic, take, image_qos(reliable=reliable)
        )

    def _hear_best_effort(self, source: CameraInput) -> None:
        """A reliable subscription hears no best-effort camera; follow what the camera offers."""
        reliability = image_qos().reliability
        if self._image_subscriptions[source.name].qos_profile.reliability != reliability:
            return
        offers = self.get_publishers_info_by_topic(source.image_topic)
        if any(offer.qos_profile.reliability != reliability for offer in offers):
            self.get_logger().info(f"{source.image_topic} is best effort, listening likewise")
            self._listen_to(source, reliable=False)

    def _on_reset(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._worker.reset()
        response.success = True
        response.message = "the next set of images is tracked as if it were the first"
        return response

    async def _on_learn(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        learning = Learning(
            self._source.names,
            self._settings.learn_background_sets,
            self._settings.config,
            self._settings.background_dir,
            clock=self._seconds,
        )
        self._worker.learn(learning)
        while not learning.answered:
            # The executor asks a waiting coroutine again after every callback, without a pause.
            time.sleep(_TURN_S)
            await _next_turn()
        self.get_logger().info(f"learn_background: {learning.message}")
        return learning.answer(response)

    # work, in the worker's thread unless there is a calibration file

    def _prepare(self) -> TrackerHandle | None:
        if self._fitting is None:
            rig = self._source.try_rig({source.name: source.info for source in self._inputs})
            if rig is None:
                self._status.doing("waiting for calibration")
                return None
            for source in self._inputs:
                source.camera = rig[source.name]
            self._build(rig)
        return self._fitting

    def _build(self, rig: CameraRig) -> None:
        scaled = rig.scaled(self._settings.scale)
        setup = build(self._settings, rig, scaled)
        sizes_px = {camera.name: camera.size_px for camera in scaled}
        self._tracker = setup.tracker
        self._result_file.open(setup.tracker)
        self._pictures = Pictures(self, scaled)
        self._describe(setup.tracker.body)
        self._fitting = TrackerHandle(
            setup.tracker,
            setup.start_stamp_ns,
            partial(_decode, sizes_px),
            waits=setup.tracker.segmenter(scaled.names[0]) is None,
        )

    # outputs

    def _create_publishers(self) -> None:
        latched = latched_qos()
        self._states = self.create_publisher(DiagnosticArray, "state", latched)
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self._descriptions = self.create_publisher(String, "robot_description", latched)
        self._joint_states = self.create_publisher(JointState, "joint_states", output_qos())
        self._deviations = self.create_publisher(JointState, "joint_deviations", output_qos())
        self._root_poses = self.create_publisher(
            PoseWithCovarianceStamped, "root_pose", output_qos()
        )
        self._marker_poses = self.create_publisher(PoseArray, "marker_poses", output_qos())
        self._markers = self.create_publisher(MarkerArray, "markers", output_qos())

    def _publish(self, fitted: TrackedSet) -> None:
        result, stamp_ns = fitted.result, fitted.result.stamp_ns
        self._result_file.add(result)
        if not self.context.ok():  # a signal came while this set was fitted
            return
        # The tracker may have learned more of the person's shape meanwhile.
        body = self._tracker.body
        self._describe(body)
        if result.pose is not None and result.markers_m is not None:
            pose, points = result.pose, result.markers_m
            self._joint_states.publish(messages.joint_state(body, pose, stamp_ns))
            sure = result.confidence
            self._root_poses.publish(messages.root_pose(body, pose, stamp_ns, sure))
            if sure is not None:
                self._deviations.publish(messages.joint_deviations(body, sure, stamp_ns))
            self._marker_poses.publish(messages.marker_poses(points, stamp_ns))
            if self._markers.get_subscription_count():
                self._markers.publish(messages.body_markers(body, pose, points, stamp_ns))
            self._no_pose_shown = False
        elif not self._no_pose_shown:
            self._markers.publish(messages.no_markers(stamp_ns))
            self._no_pose_shown = True
        self._pictures.publish(fitted, self._tracker)
        self._publish_state()

    def _describe(self, body: BodyModel) -> None:
        if body is not self._described:
            self._descriptions.publish(String(data=urdf(body)))
            self._described = body

    def _publish_state(self, missing: Sequence[str] | None = None) -> DiagnosticArray:
        with self._state_lock:
            if missing is not None:
                self._missing = list(missing)
            status = self._status
            values = status.values(self._sets.counts, self._sets.cameras, self._missing)
            message = messages.state_message(
                self.get_name(), values, status.state, status.stamp_ns, ready=status.ready
            )
            self._states.publish(message)
            return message

    def _tick(self) -> None:
        now_s = self._seconds()
        silent = self._sets.silent(now_s, PATIENCE_S)
        others_speak = len(silent) < len(self._inputs)
        missing: list[str] = []
        for source in self._inputs:
            missing += source.missing(source.name in silent, others_speak, now_s)
            self._hear_best_effort(source)
        missing += self._source.missing()
        message = self._publish_state(missing)
        message.header.stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(message)

    def _warn(self, text: str) -> None:
        self.get_logger().warning(text)


@coroutine
def _next_turn() -> Generator[None, None, None]:
    """Let the executor do other things."""
    yield


def _decode(sizes_px: dict[str, tuple[int, int]], name: str, message: Image) -> Any:
    return scale_image(decode_image(message, f"{name}/image_raw"), sizes_px[name])
