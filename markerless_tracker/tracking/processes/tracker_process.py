"""The parent's side of a tracker's process."""

import os
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from threading import Lock
from typing import Any, BinaryIO, NamedTuple

from markerless_tracker.body import BodyModel
from markerless_tracker.camera import CameraRig
from markerless_tracker.compiled import compiled_elsewhere
from markerless_tracker.errors import ImageError, TrackerError
from markerless_tracker.imaging import BackgroundModel, Image, Segmenter
from markerless_tracker.records import Observation, TrackResult
from markerless_tracker.tracking.cameras.check import Shift
from markerless_tracker.tracking.config import TrackerConfig
from markerless_tracker.tracking.processes.child import Child
from markerless_tracker.tracking.processes.images import Place, put, set_bytes
from markerless_tracker.tracking.processes.wire import receive, send
from markerless_tracker.tracking.setup import TrackerSetup

_MAIN = "markerless_tracker.tracking.processes.tracker_process_main"
_END_S = 1.0
"""Time that the step in progress has to end; a compilation takes longer and is aborted."""
_SETS = 3
"""Sets of images in shared memory: the one that is tracked, the one prepared, and the next."""

Views = Mapping[str, Image | Observation]


class SetOfViews(NamedTuple):
    """The views of one time, by camera: the place of an image, or an observation."""

    number: int
    stamp_ns: int
    views: dict[str, Place | Observation]


class Call(NamedTuple):
    """A method of the tracker and its arguments, or an attribute."""

    method: str
    arguments: tuple[Any, ...] = ()


class Step(NamedTuple):
    """A set to track, prepared or not."""

    views: SetOfViews
    effort: float


class Compiled(NamedTuple):
    """Progress of a compilation: the kernel, and how many are done of at most how many."""

    name: str
    done: int
    most: int


class Tracked(NamedTuple):
    """A result, and the body and the cameras if they have changed."""

    result: TrackResult
    body: BodyModel | None
    rig: CameraRig | None


@dataclass(frozen=True, eq=False)
class Handed:
    """A set that was handed over to the process.

    Attributes:
        views: the images and observations.
        sent: the message to the process.
    """

    views: Views
    sent: SetOfViews


class TrackerProcess:
    """A tracker in a process of its own, with the calls and the results, byte by byte, of
    `Tracker`.

    The process ends with this one, or when it is closed. If it ends by itself, tracking restarts in
    this process. `prepare` may be called during `step`; other calls must come from one thread at a
    time.

    Args:
        setup: makes the tracker. Its own tracker takes no steps while the process lives.
        report: called with a line if the process has ended by itself.

    Attributes:
        body: as `Tracker.body` after the last step.
        rig: as `Tracker.rig` after the last step.
    """

    def __init__(self, setup: TrackerSetup, report: Callable[[str], None] = lambda _: None) -> None:
        self._local = setup.tracker
        self._report = report
        self.body: BodyModel = setup.tracker.body
        self.rig: CameraRig = setup.tracker.rig
        self._set_bytes = set_bytes(setup.tracker.rig)
        self._number = 0
        self._cpu_s = 0.0
        self._ended = self._closed = False
        self._lock = Lock()
        # Sets are prepared during other calls, so they have their own pair of pipes.
        sets_read, sets_write = os.pipe()
        made_read, made_write = os.pipe()
        try:
            self._child = Child(
                _MAIN,
                _SETS * self._set_bytes,
                [str(sets_read), str(made_write)],
                (sets_read, made_write),
            )
        finally:
            os.close(sets_read)
            os.close(made_write)
        self._sets: BinaryIO = os.fdopen(sets_write, "wb")
        self._made: BinaryIO = os.fdopen(made_read, "rb")
        self._ask(setup.make)

    @property
    def pid(self) -> int:
        """Its process id."""
        return self._child.pid

    @property
    def cpu_s(self) -> float:
        """CPU time of the process and its children at its last answer, s."""
        return self._cpu_s + self._local.evidence.process_cpu_s

    def segmenter(self, camera: str) -> Segmenter | None:
        """As `Tracker.segmenter`, of the tracker in this process."""
        return self._local.segmenter(camera)

    @property
    def shifts(self) -> dict[str, Shift]:
        """As `Tracker.shifts`; without those of a process that has ended."""
        if self._ended:
            return self._local.shifts
        try:
            self._child.send(Call("shifts"))
            shifts, self._cpu_s = self._child.receive()
        except (EOFError, OSError, ValueError):
            return {}
        return dict(shifts)

    def warm_up(self) -> None:
        """As `Tracker.warm_up`."""
        self._call("warm_up")

    def reset(self) -> None:
        """As `Tracker.reset`."""
        self._call("reset")

    def configure(self, config: TrackerConfig) -> None:
        """As `Tracker.configure`."""
        self._local.configure(config)
        self._call("configure", config)

    def take_backgrounds(self, backgrounds: Mapping[str, BackgroundModel]) -> None:
        """As `Tracker.take_backgrounds`."""
        self._local.evidence.take_backgrounds(backgrounds)
        self._call("take_backgrounds", dict(backgrounds))

    def prepare(self, views: Views, stamp_ns: int) -> Any:
        """As `Tracker.prepare`; returns an argument for `step`."""
        if self._ended:
            return self._local.prepare(views, stamp_ns)
        handed = self._hand_over(views, stamp_ns)
        try:
            send(self._sets, handed.sent)
            error = receive(self._made)
        except (EOFError, OSError, ValueError):
            return handed  # `step` will notice that the process has ended.
        if error is not None:
            raise error
        return handed

    def step(self, views: Any, stamp_ns: int, effort: float = 1.0) -> TrackResult:
        """As `Tracker.step`."""
        if not self._ended:
            handed = views if isinstance(views, Handed) else self._hand_over(views, stamp_ns)
            answer = self._ask(Step(handed.sent, effort))
            if isinstance(answer, Tracked):
                if answer.body is not None:
                    self.body = answer.body
                if answer.rig is not None:
                    self.rig = answer.rig
                return answer.result
        given = views.views if isinstance(views, Handed) else views
        result = self._local.step(given, stamp_ns, effort)
        self.body, self.rig = self._local.body, self._local.rig
        return result

    def close(self) -> None:
        """End the process; a step that waits for it then raises a TrackerError."""
        self._closed = True
        self._child.close(_END_S)
        for stream in (self._sets, self._made):
            with suppress(OSError):
                stream.close()
        self._local.evidence.close()

    def _hand_over(self, views: Views, stamp_ns: int) -> Handed:
        """Put a set's images into shared memory."""
        with self._lock:
            number = self._number
            self._number += 1
        begin = number % _SETS * self._set_bytes
        images = {n: v for n, v in views.items() if not isinstance(v, Observation)}
        places = put(self._child.memory, images, begin, begin + self._set_bytes)
        if places is None:
            for name, image in images.items():
                segmenter = self._local.segmenter(name)
                if segmenter is not None:
                    segmenter.check(image)
            sizes = ", ".join(f"{n} {i.shape[1]}x{i.shape[0]} px" for n, i in images.items())
            raise ImageError(f"{sizes}: more pixels than the calibration's images have")
        sent = {n: v if isinstance(v, Observation) else places[n] for n, v in views.items()}
        return Handed(views, SetOfViews(number, stamp_ns, sent))

    def _call(self, method: str, *arguments: Any) -> None:
        if not self._ended:
            self._ask(Call(method, arguments))
        # `configure` has changed the local tracker already.
        if self._ended and method != "configure":
            getattr(self._local, method)(*arguments)

    def _ask(self, message: Any) -> Any:
        """Send a message; returns the answer, None if the process has ended.

        Raises:
            Exception: what the tracker raised.
        """
        try:
            self._child.send(message)
            answer = self._child.receive()
            while isinstance(answer, Compiled):
                compiled_elsewhere(*answer)
                answer = self._child.receive()
        except (EOFError, OSError, ValueError):
            self._fall_back()
            return None
        answer, self._cpu_s = answer
        if isinstance(answer, Exception):
            raise answer
        return answer

    def _fall_back(self) -> None:
        """Restart tracking in this process, unless the tracker was closed."""
        self._ended = True
        if self._closed:
            raise TrackerError("the tracker was closed")
        self._report("the tracker's process has ended; tracking begins anew in this one")
        self._local.warm_up()
