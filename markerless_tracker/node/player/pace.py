"""Publication times of the sets of a recording."""

from collections.abc import Callable


class Pace:
    """Publication times from the stamps of a recording and a rate.

    A delay above `slack_s` shifts all later times, so that no burst of late images follows. The
    delays add up in `late_s`.

    Args:
        rate: 2 plays twice as fast as recorded.
        clock: monotonic time in s.
        slack_s: delay that is caught up with.
    """

    def __init__(self, rate: float, *, clock: Callable[[], float], slack_s: float = 0.05) -> None:
        self._rate = rate
        self._clock = clock
        self._slack_s = slack_s
        self._origin: tuple[float, int] | None = None
        self.late_s = 0.0

    def wait_s(self, stamp_ns: int) -> float:
        """Seconds until the set of that stamp is due, 0 if it is due now or late."""
        now_s = self._clock()
        if self._origin is None:
            self._origin = (now_s, stamp_ns)
        start_s, first_ns = self._origin
        due_s = start_s + (stamp_ns - first_ns) / 1e9 / self._rate
        if now_s - due_s > self._slack_s:
            self.late_s += now_s - due_s
            self._origin = (now_s, stamp_ns)
        return max(0.0, due_s - now_s)

    def begin(self) -> None:
        """Publish the next set at once, whatever its stamp."""
        self._origin = None
