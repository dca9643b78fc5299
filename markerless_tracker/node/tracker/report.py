"""The verdict of a live run."""

from collections.abc import Mapping
from threading import Lock

from markerless_tracker.body import BodyModel, load_description
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
}
"""Count of `state` -> words, for sets that were not tracked, except skipped ones."""

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
        self._tracker: Tracker | None = None
        self._record: RunRecord | None = None
        self._doubts: tuple[str, ...] = ()

    def begin(self, tracker: Tracker, rig: CameraRig) -> tuple[str, ...]:
        """Set the tracker; returns doubts about the cameras, one line each."""
        with self._lock:
            self._tracker, self._record = tracker, RunRecord(tracker.rig)
            self._doubts = calibration_doubts(rig)
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

    def verdict(self) -> Verdict | None:
        """The verdict so far; None before the first result."""
        with self._lock:
            if self._record is None or self._tracker is None or not self._record.frames:
                return None
            # Without the search for exchanged cameras, since a node must end soon after a signal.
            return verdict_of(
                self._record,
                load_description(self._tracker.config.body),
                known=self._doubts,
                start_given=self._start_given,
                search_faults=False,
                pictures=_PICTURES,
            )
