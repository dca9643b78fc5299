"""After which sets the state is published."""

LEAST_S = 0.05
"""Time between two states while newer sets wait; making a state takes time from them."""


class StatePace:
    """Publishes the state after each set; while newer sets wait, every `LEAST_S` only."""

    def __init__(self) -> None:
        self._published_s: float | None = None

    def published(self, now_s: float) -> None:
        """A state was published."""
        self._published_s = now_s

    def due(self, now_s: float, arrived_s: float, newest_s: float | None) -> bool:
        """Whether to publish one after a set.

        Args:
            now_s: the time, s.
            arrived_s: when the set was complete.
            newest_s: when the newest set was complete, None if none was.
        """
        waits = newest_s is not None and newest_s > arrived_s
        last_s = self._published_s
        return not waits or last_s is None or now_s - last_s >= LEAST_S
