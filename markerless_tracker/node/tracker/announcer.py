"""Log lines of a running tracker: changes of state, warnings, missing results."""

from collections.abc import Callable

from markerless_tracker.node.health import Health
from markerless_tracker.node.ros.notices import Notices, kind_of
from markerless_tracker.records import TrackResult, TrackState

_NEWS = {
    TrackState.TRACKING: "person found",
    TrackState.LOST: "person lost",
    TrackState.SEARCHING: "searching for a person",
}


class Announcer:
    """Logs changes.

    Args:
        inform: logs a line as information.
        notices: logs warnings, repetitions counted.
    """

    def __init__(self, inform: Callable[[str], None], notices: Notices) -> None:
        self._inform = inform
        self._notices = notices
        self._state = TrackState.SEARCHING
        self._trouble = ""

    def result(self, result: TrackResult) -> None:
        """Log a change of state, and the warnings of a result."""
        if result.state is not self._state:
            self._inform(f"stamp {result.stamp_ns}: {_NEWS[result.state]}")
            self._state = result.state
        for warning in result.warnings:
            self._notices.say(f"stamp {result.stamp_ns}: {warning}")

    def health(self, health: Health) -> None:
        """Log the reason for missing results when it changes, and its end."""
        if kind_of(health.trouble) != kind_of(self._trouble):
            if health.trouble:
                self._notices.say(health.trouble)
            else:
                self._inform("images are tracked")
            self._trouble = health.trouble
