"""Measures which share of the complete sets was skipped lately."""

from collections import deque

WINDOW_S = 5.0
"""Time over which the share is measured."""
EVERY_S = 0.5
"""Least time between two counts that are kept."""


class SkippedShare:
    """Share of the sets that were skipped for newer ones, over the last `WINDOW_S`."""

    def __init__(self) -> None:
        self._counts: deque[tuple[float, int, int]] = deque()

    def update(self, now_s: float, tracked: int, skipped: int) -> float | None:
        """The share, 0 to 1; None before `WINDOW_S` have passed, and without sets.

        Args:
            now_s: monotonic time.
            tracked: number of sets that were tracked so far.
            skipped: number of sets that were skipped so far.
        """
        if not self._counts or now_s - self._counts[-1][0] >= EVERY_S:
            self._counts.append((now_s, tracked, skipped))
        # The oldest count is the latest of those that are `WINDOW_S` old.
        while len(self._counts) > 1 and now_s - self._counts[1][0] >= WINDOW_S:
            self._counts.popleft()
        then_s, tracked_then, skipped_then = self._counts[0]
        sets = tracked - tracked_then + skipped - skipped_then
        if now_s - then_s < WINDOW_S or sets <= 0:
            return None
        return (skipped - skipped_then) / sets
