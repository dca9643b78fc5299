"""The node `tracker`: image topics in, the pose of one person out."""

import time
from collections.abc import Callable, Sequence
from functools import partial
from threading import Lock
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.clock import Clock
from rclpy.clock_type import ClockType

from markerless_tracker.body import BodyModel
from markerless_tracker.calibration.contours.time_offset import TimeOffsetEstimate
from markerless_tracker.camera import CameraRig
from markerless_tracker.libraries import usable_cores
from markerless_tracker.node.health import QUIET_S, Facts, assess
from markerless_tracker.node.inputs.topics import CameraTopics
from markerless_tracker.node.ros import messages
from markerless_tracker.node.ros.declared import GivenNode, declare_effective, given_parameters
from markerless_tracker.node.ros.notices import Notices
from markerless_tracker.node.ros.qos import latched_qos
from markerless_tracker.node.tracker import parameters
from markerless_tracker.node.tracker.announcer import Announcer
from markerless_tracker.node.tracker.cameras.build import make_inputs, view_reader
from markerless_tracker.node.tracker.changes import LIVE, LiveSettings
from markerless_tracker.node.tracker.handle import TrackedSet, TrackerHandle
from markerless_tracker.node.tracker.pace.skipping import SkippedShare
from markerless_tracker.node.tracker.pace.states import StatePace
from markerless_tracker.node.tracker.pace.waiting import kept_sets
from markerless_tracker.node.tracker.publishing.files import Pictures, ResultFile
from markerless_tracker.node.tracker.publishing.results import ResultPublishers
from markerless_tracker.node.tracker.report import RunReport, sets_line
from markerless_tracker.node.tracker.services import Services
from markerless_tracker.node.tracker.setup import RigSource, build
from markerless_tracker.node.tracker.status import NOTED, TrackerStatus
from markerless_tracker.node.tracker.synchronizer import Synchronizer
from markerless_tracker.node.tracker.worker import TrackWorker
from markerless_tracker.records import TrackState
from markerless_tracker.tracking import Tracker
from markerless_tracker.tracking.processes.images import set_bytes
from markerless_tracker.tracking.processes.tracker_process import TrackerProcess

STATE_PERIOD_S = 0.5


class TrackerNode(GivenNode):
    """Receives images, and publishes the results of its worker thread.

    Callbacks only store data; `TrackWorker` does the work and reads the files. `fatal` reports
    errors in the files. Call `close` before `destroy_node`.

    Args:
        node_arguments: passed on to ``rclpy.node.Node`` (context, parameter_overrides, ...).

    Raises:
        TrackerError: unknown or impossible parameters, no calibration, or a result file that
            cannot be written.
    """

    def __init__(self, **node_arguments: Any) -> None:
        super().__init__("tracker", **node_arguments)
        given = given_parameters(self)
        self._settings = parameters.read_settings(given)
        declare_effective(
            self,
            parameters.effective_values(self._settings),
            parameters.descriptions(),
            parameters.held_settings(),
            live=LIVE,
        )
        self._live = LiveSettings(
            self, parameters.tracker_settings(given), self._settings.config, self._inform
        )
        self._seconds: Callable[[], float] = time.monotonic
        self._notices = Notices(self._log_warning, self._seconds)
        self._news = Notices(self._inform, self._seconds)
        self._announcer = Announcer(self._news, self._notices)
        self._source = RigSource(self._settings)
        self._status = TrackerStatus()
        self._sets: Synchronizer[Any] = Synchronizer(
            self._source.names, tolerance_ns=round(self._settings.sync_tolerance * 1e9)
        )
        self._tracker: Tracker | TrackerProcess | None = None
        self._end_process: Callable[[], None] = lambda: None
        self._time_offsets: TimeOffsetEstimate | None = None
        self._subject: BodyModel | None = None
        self._missing: Sequence[str] = ()
        self._repeated = (0, 0.0)
        self._skipped = SkippedShare()
        self._late_ns: int | None = None
        self._state_lock = Lock()
        self._state_pace = StatePace()
        self._started_s = self._seconds()
        self._result_file = ResultFile(
            self._settings.result_file, overwrite=self._settings.overwrite, report=self._warn
        )
        self._report = RunReport(start_given=self._settings.start_file is not None)
        self._results = ResultPublishers(self, self._settings, self._source.rig, self._inform)
        self._states = self.create_publisher(DiagnosticArray, "state", latched_qos())
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self._worker = TrackWorker(
            self._sets,
            self._status,
            prepare=self._prepare,
            publish=self._publish,
            report=self._warn,
            inform=self._inform,
            dealt=self._dealt,
            clock=self._seconds,
        )
        self._inputs = make_inputs(
            self._settings,
            self._source,
            self._sets,
            self._status,
            channels=self._background_channels,
            report=self._warn,
            clock=self._seconds,
        )
        self._listen()
        self._worker.start()

    @property
    def fatal(self) -> str | None:
        """Reason why the tracker cannot start; None otherwise."""
        return self._worker.fatal

    @property
    def _image_cameras(self) -> tuple[str, ...]:
        """The cameras whose images are received."""
        takes_evidence = self._settings.takes_evidence
        return tuple(name for name in self._source.names if not takes_evidence(name))

    def close(self, timeout_s: float = 3.0) -> bool:
        """Stop the worker and complete the result files; returns whether the worker ended.

        Raises:
            DatasetError: the result files cannot be completed.
        """
        ended = self._worker.stop(timeout_s)
        shifts = self._tracker.shifts if ended and self._tracker is not None else {}
        self._end_process()
        self._notices.flush(last=True)
        self._news.flush(last=True)
        counts = self._status.values(self._sets.counts, (), ())
        notes: dict[str, Any] = {"node": {key: counts[key] for key in NOTED}}
        notes["cameras"] = {name: shift.as_mapping() for name, shift in shifts.items()}
        notes["scale"] = self._settings.scale
        verdict = self._report.verdict()
        if verdict is not None:
            for line in (verdict.counts, sets_line(counts), *verdict.lines()):
                self._inform(line)
            notes["verdict"] = verdict.as_mapping()
        if self._live.record:
            notes["changed"] = self._live.record
        written = self._result_file.close(notes)
        if written is not None:
            self._inform(written)
        return ended

    # inputs

    def _listen(self) -> None:
        self._topics = CameraTopics(
            self, self._inputs, transport=self._settings.image_transport, clock=self._seconds
        )
        self._source.listen(self, self._warn)
        self._requests = Services(
            self,
            self._worker,
            self._settings,
            cameras=self._image_cameras,
            rig=lambda: self._source.rig,
            person=self._person,
            clock=self._seconds,
            inform=self._inform,
        )
        # A steady clock: the state must be published while simulated time stops without /clock.
        self.create_timer(STATE_PERIOD_S, self._tick, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _background_channels(self, camera: str) -> int | None:
        """Channels of a camera's background; None if there is none or it is being learned."""
        if self._tracker is None or self._worker.learning:
            return None
        segmenter = self._tracker.segmenter(camera)
        return None if segmenter is None else segmenter.background.channels

    def _person(self) -> BodyModel | None:
        """The body of the person tracked last; None before a start was complete."""
        return self._subject

    # work, in the worker's thread

    def _prepare(self) -> TrackerHandle | None:
        rig = self._source.try_rig({source.name: source.info for source in self._inputs})
        if rig is None:
            self._status.doing("waiting for calibration")
            return None
        for source in self._inputs:
            source.camera = rig[source.name]
        return self._build(rig)

    def _build(self, rig: CameraRig) -> TrackerHandle:
        self._status.doing("reading the backgrounds and the start")
        scaled = rig.scaled(self._settings.scale)
        setup = build(self._settings, rig, scaled)
        tracker: Tracker | TrackerProcess = setup.tracker
        if (self._settings.config.threads or usable_cores()) > 1:
            process = tracker = TrackerProcess(setup, self._warn)
            self._end_process = process.close
            self._status.add_cpu_of(lambda: process.cpu_s)
        self._pictures = Pictures(self, scaled.names)
        self._results.describe(setup.tracker.body)
        self._tracker = tracker
        self._time_offsets = TimeOffsetEstimate(
            setup.tracker.rig, step_px=self._settings.config.edges.step_px
        )
        self._result_file.begin(setup.tracker)
        for doubt in self._report.begin(setup.tracker, rig):
            self._warn(doubt)
        return TrackerHandle(
            self._live.settable(tracker),
            setup.start_stamp_ns,
            view_reader(scaled, self._inputs),
            waits=any(setup.tracker.segmenter(name) is None for name in self._image_cameras),
            warm_up=partial(self._warm_up, setup.tracker.body),
            kept=kept_sets(set_bytes(rig)),
            searches=self._settings.start_file is None,
        )

    def _warm_up(self, body: BodyModel) -> None:
        """Compile what the node uses besides the tracker."""
        if self._time_offsets is not None:
            self._time_offsets.warm_up(body)
        self._report.warm_up(body)

    # outputs

    def _publish(self, tracked: TrackedSet) -> None:
        assert self._tracker is not None and self._time_offsets is not None
        self._result_file.add(tracked.result, tracked.body)
        self._report.add(tracked.result, tracked.body)
        self._announcer.result(tracked.result)
        self._announcer.doubts(self._report.doubts)
        if tracked.result.state is TrackState.TRACKING and not tracked.result.settling:
            self._subject = tracked.body
        if not self.context.ok():  # a signal was received while this set was tracked
            return
        self._results.publish(tracked.result, tracked.body)
        self._pictures.publish(tracked, self._tracker.segmenter)
        self._time_offsets.add(tracked.result, tracked.body)
        self._announcer.time_offsets(self._time_offsets.by_camera, self._source.offsets_s)

    def _dealt(self, arrived_s: float) -> None:
        """Publish the state after a set was processed; not after each while newer sets wait."""
        if not self.context.ok():
            return
        if self._state_pace.due(self._seconds(), arrived_s, self._sets.complete_s):
            self._publish_state()

    def _publish_state(self, missing: Sequence[str] | None = None) -> DiagnosticArray:
        now_s = self._seconds()
        with self._state_lock:
            self._state_pace.published(now_s)
            if missing is not None:
                self._missing = list(missing)
            late_ns = self._sets.late_ns
            if late_ns is not None and late_ns != self._late_ns:
                self._late_ns = late_ns
                self._status.dealt_with(late_ns)
            health = assess(self._facts(now_s))
            values = self._status.values(
                self._sets.counts,
                self._sets.cameras,
                self._missing,
                now_s=now_s,
                views=self._sets.camera_counts,
                time_offsets={} if self._time_offsets is None else self._time_offsets.by_camera,
            )
            values["doubts"] = "; ".join(self._report.doubts)
            message = messages.state_message(
                self.get_fully_qualified_name(), values, health, self._status.stamp_ns
            )
            self._announcer.health(health)
            self._states.publish(message)
            return message

    def _facts(self, now_s: float) -> Facts:
        def age(then_s: float | None) -> float | None:
            return None if then_s is None else now_s - then_s

        duplicates = self._sets.counts.duplicates
        if duplicates != self._repeated[0]:
            self._repeated = (duplicates, now_s)
        refusals = {source.name: source.refusal for source in self._inputs if source.refusal}
        set_age_s = age(self._sets.complete_s)
        simulated = bool(self.get_parameter("use_sim_time").value)
        return Facts(
            ready=self._status.ready,
            activity=self._status.activity,
            state=self._status.state,
            cameras=self._sets.cameras,
            silent=self._sets.silent(now_s, QUIET_S),
            left_out=self._sets.left_out(now_s),
            refusals=refusals,
            ready_age_s=age(self._status.became_ready_s()),
            set_age_s=set_age_s,
            result_age_s=age(self._status.finished_s()),
            offsets_ns=self._sets.offsets_ns() if set_age_s is None or set_age_s > QUIET_S else {},
            tolerance_s=self._settings.sync_tolerance,
            repeating=self._repeated[0] > 0 and now_s - self._repeated[1] < QUIET_S,
            last_error=self._status.last_set_error(),
            clock_missing=simulated
            and now_s - self._started_s > QUIET_S
            and self.get_clock().now().nanoseconds == 0,
            doubts=self._report.doubts,
            skipped=self._skipped_share(now_s),
        )

    def _skipped_share(self, now_s: float) -> float | None:
        if not self._status.ready:
            return None
        return self._skipped.update(now_s, self._status.tracked_sets, self._sets.counts.skipped)

    def _tick(self) -> None:
        now_s = self._seconds()
        silent = self._sets.silent(now_s, QUIET_S)
        left_out = self._sets.left_out(now_s)
        others_send = len(silent) < len(self._inputs)
        missing: list[str] = []
        for source in self._inputs:
            name = source.name
            missing += source.missing(name in silent, name in left_out, others_send, now_s)
        self._topics.tick()
        missing += self._source.missing()
        message = self._publish_state(missing)
        message.header.stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(message)
        self._notices.flush()
        self._news.flush()

    def _warn(self, text: str) -> None:
        self._notices.say(text)

    def _log_warning(self, text: str) -> None:
        self.get_logger().warning(text)

    def _inform(self, text: str) -> None:
        self.get_logger().info(text)
