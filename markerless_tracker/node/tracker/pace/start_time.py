"""Which set is the first that is tracked."""

START_TOLERANCE_NS = 4_000_000
"""Tolerance when a frame is compared with the start row's time: marker files round their times, and
frames are further apart (8.3 ms at 120 fps)."""


class StartTimeGate:
    """Drops sets before the start row's time, once.

    A stream that begins later than that time, or a start without a time, begins with its first
    complete set.

    Args:
        start_ns: the start row's time, None if there is none.
    """

    def __init__(self, start_ns: int | None) -> None:
        self._start_ns = start_ns
        self._open = start_ns is None

    def admits(self, stamp_ns: int) -> bool:
        """Whether a set of that stamp is to be tracked."""
        if not self._open and self._start_ns is not None:
            self._open = stamp_ns >= self._start_ns - START_TOLERANCE_NS
        return self._open
