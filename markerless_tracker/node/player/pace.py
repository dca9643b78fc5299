"""Publication times of the sets of a recording."""

from collections.abc import Callable


class Pace:
    """Publication times from the stamps of a recording and a rate.

    The times are relative to the first set, so that delays do not add up. After a delay, overdue
    sets follow at most twice as fast as recorded, so that there is no burst of images. A delay
    above `slack_s` shifts all later times; `shifted_s` is the sum of such delays.

    Args:
        rate: 2 plays twice as fast as recorded.
        clock: monotonic time in s.
        slack_s: largest delay that later sets make up for.
    """

    def __init__(self, rate: float, *, clock: Callable[[], float], slack_s: float = 1.0) -> None:
        self._rate = rate
        self._clock = clock
        self._slack_s = slack_s
        self._origin: tuple[float, int] | None = None
        self._last: tuple[float, int] | None = None
        self.shifted_s = 0.0
        self.late_s = 0.0

    def wait_s(self, stamp_ns: int) -> float:
        """Seconds until the set of a stamp is to be sent; 0 if it is due now or overdue.

        `late_s` is then its delay.
        """
        now_s = self._clock()
        if self._origin is None:
            self._origin = (now_s, stamp_ns)
        start_s, first_ns = self._origin
        due_s = start_s + (stamp_ns - first_ns) / 1e9 / self._rate
        if now_s - due_s > self._slack_s:
            self.shifted_s += now_s - due_s
            self._origin, due_s = (now_s, stamp_ns), now_s
        at_s = max(now_s, due_s)
        if self._last is not None:
            sent_s, sent_ns = self._last
            at_s = max(at_s, sent_s + 0.5 * (stamp_ns - sent_ns) / 1e9 / self._rate)
        self._last = (at_s, stamp_ns)
        self.late_s = at_s - due_s
        return at_s - now_s

    def held(self, seconds: float) -> None:
        """Shift all later times by a pause, which does not count as a delay."""
        if self._origin is not None:
            self._origin = (self._origin[0] + seconds, self._origin[1])
        if self._last is not None:
            self._last = (self._last[0] + seconds, self._last[1])
