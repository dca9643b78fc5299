"""When each set of a recording is due."""

from collections.abc import Callable


class Pace:
    """Due times that keep a recording's own pace, times a rate.

    Falling behind by more than `slack_s` moves all later due times: a burst of late images helps
    nobody. What was lost that way adds up in `late_s`.

    Args:
        rate: 2 plays twice as fast as recorded.
        clock: seconds that only go forward.
        slack_s: lateness that is caught up with.
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
        """The next set is due at once, whatever its stamp."""
        self._origin = None
