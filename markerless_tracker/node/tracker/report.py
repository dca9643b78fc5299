"""The verdict of a live run."""

from collections.abc import Mapping, Sequence
from threading import Lock

from markerless_tracker.body import BodyModel, load_description
from markerless_tracker.body.description import BodyDescription
from markerless_tracker.camera import CameraRig
from markerless_tracker.camera.doubts import calibration_doubts
from markerless_tracker.records import TrackResult
from markerless_tracker.results.verdict.record import RunRecord
from markerless_tracker.results.verdict.verdict import Verdict, verdict_of
from markerless_tracker.tracking import Tracker

_LEFT_OUT = {
    "incomplete": "incomplete",
    "late": "late",
    "dropped_before_ready": "before the tracker was ready",
    "dropped_before_start": "before the start frame",
    "dropped_while_learning": "while learning",
    "dropped_on_error": "with an error",
    "dropped_at_end": "waiting at the end",
}
"""Count of `state` -> words, for sets that were not tracked, except skipped ones."""

LOOK_NS = 2_000_000_000
"""Time between two looks for doubts, by the images' stamps. The first look comes that long after
the first result."""

_PICTURES = "while it runs the topics debug/NAME/evidence show silhouettes and body"


def sets_line(counts: Mapping[str, str]) -> str:
    """A line with the number of sets that were not tracked, and the reasons.

    Args:
        counts: the values of `state`.
    """
    others = [f"{counts[key]} {words}" for key, words in _LEFT_OUT.items() if counts[key] != "0"]
    skipped = f"sets of images not tracked: {counts['skipped']} skipped for newer ones"
    return ", ".join((skipped, *others))


class RunReport:
    """Takes the results of a tracker. Safe to use from several threads.

    Args:
        start_given: whether the run begins with a start pose.
    """

    def __init__(self, *, start_given: bool) -> None:
        self._start_given = start_given
        self._lock = Lock()
        self._record: RunRecord | None = None
        self._description: BodyDescription | None = None
        self._known: tuple[str, ...] = ()
        self._doubts: tuple[str, ...] = ()
        self._looked_ns: int | None = None

    def begin(self, tracker: Tracker, rig: CameraRig) -> tuple[str, ...]:
        """Set the tracker; returns doubts about the cameras, one line each."""
        with self._lock:
            self._record = RunRecord(tracker.rig)
            self._description = load_description(tracker.config.body)
            self._known = calibration_doubts(rig)
            return self._known

    @property
    def doubts(self) -> tuple[str, ...]:
        """Doubts about the run so far, one line each, without those that `begin` returned."""
        with self._lock:
            return self._doubts

    def warm_up(self, body: BodyModel) -> None:
        """Compile what a result needs, for bodies of this kind."""
        if self._record is not None:
            self._record.static.warm_up(body)

    def add(self, result: TrackResult, body: BodyModel) -> None:
        """Take a result and the present body."""
        with self._lock:
            if self._record is not None:
                self._record.add(result, body)
                self._look(result.stamp_ns)

    def verdict(self) -> Verdict | None:
        """The verdict so far; None before the first result."""
        with self._lock:
            return self._verdict(self._known)

    def _look(self, stamp_ns: int) -> None:
        """Look for doubts if it is time to and a person was tracked; stamps may run backwards."""
        if self._looked_ns is None:
            self._looked_ns = stamp_ns
        if abs(stamp_ns - self._looked_ns) < LOOK_NS:
            return
        self._looked_ns = stamp_ns
        # Why nobody was found is said at the end only: it needs the visual hull.
        if self._record is not None and self._record.tracked:
            verdict = self._verdict(())
            self._doubts = () if verdict is None else verdict.doubts

    def _verdict(self, known: Sequence[str]) -> Verdict | None:
        if self._record is None or self._description is None or not self._record.frames:
            return None
        # Without the search for exchanged cameras, which would delay the results and the end.
        return verdict_of(
            self._record,
            self._description,
            known=known,
            start_given=self._start_given,
            search_faults=False,
            pictures=_PICTURES,
        )
