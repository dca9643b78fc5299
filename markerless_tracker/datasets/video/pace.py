"""Whether the images of a video follow each other at a constant rate."""

from typing import NamedTuple

_RATE_ERROR = 1e-4
"""Accepted error of a stated rate, as a share of it."""


class Uneven(NamedTuple):
    """An image that is not where a constant rate has it.

    Attributes:
        frame: number of the image in its video, from 0.
        late_s: its time less that of a constant rate, s.
    """

    frame: int
    late_s: float


class Pace:
    """Compares the times of a video's images with its rate, until one differs.

    Args:
        fps: rate that the container states, 1/s; None = unknown, nothing is compared.

    Attributes:
        uneven: the first image that is more than half a period from a constant rate; None without.
    """

    def __init__(self, fps: float | None) -> None:
        self._fps = fps
        self._count = 0
        self._first_s = self._last_s = 0.0
        self.uneven: Uneven | None = None

    def add(self, time_s: float) -> None:
        """Take the next image's time; times that do not increase end the comparison."""
        if self._fps is None or self.uneven is not None:
            return
        index, self._count = self._count, self._count + 1
        if index == 0:
            self._first_s = self._last_s = time_s
            return
        if not time_s > self._last_s:
            # The container has no times.
            self._fps = None
            return
        self._last_s = time_s
        even_s = index / self._fps
        late_s = time_s - self._first_s - even_s
        if abs(late_s) > 0.5 / self._fps + _RATE_ERROR * even_s:
            self.uneven = Uneven(index, late_s)
