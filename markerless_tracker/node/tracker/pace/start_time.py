"""Selects the first set that is tracked."""

START_TOLERANCE_NS = 4_000_000
"""Tolerance between a frame's stamp and the start row's time: marker files round their times. It is
less than half the time between frames at 120 fps (8.3 ms)."""


class StartTimeGate:
    """Drops the sets before the start row's time.

    Without a time, or if the stream begins after it, tracking begins with the first complete set.

    Args:
        start_ns: time of the start row; None if there is none.
    """

    def __init__(self, start_ns: int | None) -> None:
        self._start_ns = start_ns
        self._open = start_ns is None

    def admits(self, stamp_ns: int) -> bool:
        """Whether a set with a stamp is to be tracked."""
        if not self._open and self._start_ns is not None:
            self._open = stamp_ns >= self._start_ns - START_TOLERANCE_NS
        return self._open
