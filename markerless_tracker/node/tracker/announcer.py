"""Log lines of a running tracker: one per event, with the words of `state` and the diagnostics."""

import sys
import time
from collections.abc import Callable, Iterable, Mapping

from markerless_tracker.calibration.contours.time_offset import TimeOffset
from markerless_tracker.node.health import NEWS, Health
from markerless_tracker.node.ros.notices import Notices, kind_of
from markerless_tracker.records import TrackResult, TrackState

LONG_S = 5.0
"""Time after which the log reports that a first start may take long."""
PROGRESS_S = 20.0
"""Time between two lines of progress while kernels are compiled, in a terminal."""


class CompilingLines:
    """Log lines while kernels are compiled: one at the beginning, one after `LONG_S`.

    In a terminal the progress is logged every `PROGRESS_S`; otherwise only `state` shows it.

    Args:
        inform: logs a line.
        clock: monotonic time in s.
        terminal: whether the log is shown in a terminal; None: whether standard error is one.
    """

    def __init__(
        self,
        inform: Callable[[str], None],
        clock: Callable[[], float] = time.monotonic,
        *,
        terminal: bool | None = None,
    ) -> None:
        self._inform = inform
        self._clock = clock
        self._terminal = sys.stderr.isatty() if terminal is None else terminal
        self._next_s = clock() + LONG_S
        self._long = False
        inform("compiling what is not stored from an earlier start")

    def progress(self, activity: str) -> None:
        """Log the activity if a line is due."""
        now_s = self._clock()
        if now_s < self._next_s:
            return
        self._next_s = now_s + PROGRESS_S
        if not self._long:
            self._inform(
                f"{activity}, which takes about half a minute at a first start "
                "(`markerless_tracker compile` does it at install time)"
            )
        elif self._terminal:
            self._inform(activity)
        self._long = True


class Announcer:
    """Logs changes: the person found and lost, cameras lost and recovered, warnings, doubts.

    A line about the person begins like the message of `state`. Repetitions are counted.

    Args:
        news: logs lines as information.
        notices: logs lines as warnings.
    """

    def __init__(self, news: Notices, notices: Notices) -> None:
        self._news = news
        self._notices = notices
        self._state = TrackState.SEARCHING
        self._found = False
        self._trouble = self._without = ""
        self._skipping = False
        self._late: set[str] = set()
        self._doubted: set[str] = set()

    def result(self, result: TrackResult) -> None:
        """Log a change of state, and the warnings of a result."""
        if result.state is not self._state:
            words = NEWS[result.state]
            if result.state is TrackState.TRACKING:
                words, self._found = f"{words}{' again' * self._found}", True
            self._news.say(f"{result.state.value}: {words} (stamp {result.stamp_ns})")
            self._state = result.state
        for warning in result.warnings:
            self._notices.say(f"stamp {result.stamp_ns}: {warning}")

    def doubts(self, found: Iterable[str]) -> None:
        """Log each kind of doubt about the run, once."""
        for doubt in found:
            if kind_of(doubt) not in self._doubted:
                self._doubted.add(kind_of(doubt))
                self._notices.say(f"doubt: {doubt}")

    def health(self, health: Health) -> None:
        """Log lost and recovered cameras, the reason for missing results, and its end.

        That most sets are skipped is logged once.
        """
        if health.skipping and not self._skipping:
            self._notices.say(health.skipping)
            self._skipping = True
        if health.without is not None and kind_of(health.without) != kind_of(self._without):
            if health.without:
                self._notices.say(f"{self._state.value}: {health.without}")
            else:
                self._news.say(f"{self._state.value}: every camera is used again")
            self._without = health.without
        if health.trouble is not None and kind_of(health.trouble) != kind_of(self._trouble):
            if health.trouble:
                self._notices.say(health.trouble)
            else:
                self._news.say("images are tracked")
            self._trouble = health.trouble

    def time_offsets(self, found: Mapping[str, TimeOffset], given_s: Mapping[str, float]) -> None:
        """Log each camera whose images are surely late, once, with the parameter that corrects it.

        Args:
            found: the remaining offsets of the cameras, by name.
            given_s: the offsets in effect, of all cameras in their order.
        """
        late = {n: one for n, one in found.items() if one.certain and n not in self._late}
        if not late:
            return
        self._late |= set(late)
        listed = ", ".join(
            f"{name} by {one.offset_s * 1e3:+.0f} ms (sd {one.sd_s * 1e3:.1f} ms)"
            for name, one in late.items()
        )
        right_s = {
            name: value_s + (found[name].offset_s if name in self._late else 0.0)
            for name, value_s in given_s.items()
        }
        values = ", ".join(f"{value:.3f}" for value in right_s.values())
        self._notices.say(
            f"images are late, by the person's motion: {listed}; "
            f'stamp_offsets:="[{values}]" corrects it'
        )


def ready_line(activity: str, kernels: int, seconds: float) -> str:
    """The log line when the tracker is ready.

    Args:
        activity: its activity from now on.
        kernels: number of kernels that were compiled; the others were stored by an earlier start.
        seconds: duration, including that of loading.
    """
    return f"ready, {activity}; {kernels} kernels compiled, {seconds:.1f} s"
