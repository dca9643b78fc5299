"""Lockstep: the next set is sent when all trackers have processed the last set."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass


@dataclass
class _Tracker:
    dealt_ns: int
    last_state_s: float
    waited_for: bool = True


class Lockstep:
    """Keeps which trackers have not yet processed the set that was sent.

    A tracker counts as soon as its `state` says ready. After a timeout, a tracker is not waited for
    until it has processed another set. A tracker whose `state` is not received for the timeout is
    forgotten.

    Args:
        timeout_s: longest wait for one set.
        clock: monotonic time in s.
    """

    def __init__(self, timeout_s: float, *, clock: Callable[[], float]) -> None:
        self._timeout_s = timeout_s
        self._clock = clock
        self._trackers: dict[str, _Tracker] = {}
        self._sent: tuple[int, float] | None = None

    @property
    def alone(self) -> bool:
        """Whether there is no tracker to wait for."""
        return not any(tracker.waited_for for tracker in self._trackers.values())

    def update(self, name: str, values: Mapping[str, str]) -> None:
        """Take the values of the `state` of a tracker."""
        if values.get("ready") != "true" or "dealt_with_ns" not in values:
            self._trackers.pop(name, None)
            return
        try:
            dealt_ns = int(values["dealt_with_ns"] or -1)
        except ValueError:
            return  # It is no tracker's.
        known = self._trackers.setdefault(name, _Tracker(dealt_ns, self._clock()))
        known.last_state_s = self._clock()
        if dealt_ns != known.dealt_ns:
            known.dealt_ns, known.waited_for = dealt_ns, True

    def sent(self, stamp_ns: int) -> None:
        """Begin to wait until the set of a stamp is processed."""
        self._sent = (stamp_ns, self._clock())

    def waiting_for(self) -> list[str]:
        """Names of the trackers that have not processed the set; empty when the next is due."""
        if self._sent is None:
            return []
        now_s = self._clock()
        for name in [
            n for n, t in self._trackers.items() if now_s - t.last_state_s > self._timeout_s
        ]:
            del self._trackers[name]
        return [
            name
            for name, tracker in self._trackers.items()
            if tracker.waited_for and tracker.dealt_ns != self._sent[0]
        ]

    def overdue(self) -> list[str]:
        """Names of the trackers that have just timed out; they are no longer waited for."""
        if self._sent is None or self._clock() - self._sent[1] < self._timeout_s:
            return []
        late = self.waiting_for()
        for name in late:
            self._trackers[name].waited_for = False
        return late
