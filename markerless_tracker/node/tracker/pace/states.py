"""Decides after which sets the state is published."""

LEAST_S = 0.05
"""Least time between two states while newer sets wait, which a state would delay."""


class StatePace:
    """Allows a state after each set; while newer sets wait, only every `LEAST_S`."""

    def __init__(self) -> None:
        self._published_s: float | None = None

    def published(self, now_s: float) -> None:
        """Note that a state was published."""
        self._published_s = now_s

    def due(self, now_s: float, arrived_s: float, newest_s: float | None) -> bool:
        """Whether to publish the state after a set.

        Args:
            now_s: the time, s.
            arrived_s: time at which the set was complete.
            newest_s: time at which the newest set was complete; None if there is none.
        """
        waits = newest_s is not None and newest_s > arrived_s
        last_s = self._published_s
        return not waits or last_s is None or now_s - last_s >= LEAST_S
