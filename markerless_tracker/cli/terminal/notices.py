"""Progress and warnings of a run of `track`."""

import math
from collections.abc import Iterable

from rich.console import Console

from markerless_tracker.cli.terminal.bars import progress_bars, warn
from markerless_tracker.records import TrackState

COMPILING = "compiling"
"""Name of the part of a run in which kernels are compiled or loaded."""


class Notices:
    """Receives the events of `track_source`; the base class ignores them."""

    def begin(self, part: str, total: int | None = None) -> None:
        """Receives the name of the next part and the number of its steps (None = unknown)."""

    def step(self, done: int, total: int | None = None) -> None:
        """Receives the number of the part's completed steps, and their total if it changed."""

    def pose(self, state: TrackState, overlap: Iterable[float]) -> None:
        """Receives the state after a frame, and the overlap (IoU) of each view with the body."""

    def warn(self, text: str) -> None:
        """Receives a warning, one line."""


class Bars(Notices):
    """A progress bar in a terminal, shown from the first part on, and warnings above it."""

    def __init__(self, console: Console) -> None:
        self._bars = progress_bars(console)
        self._task = self._bars.add_task("", total=None)

    def __enter__(self) -> "Bars":
        return self

    def __exit__(self, *error: object) -> None:
        if self._bars.live.is_started:
            self._bars.stop()

    def begin(self, part: str, total: int | None = None) -> None:
        """Show the next part."""
        self._bars.start()
        self._bars.remove_task(self._task)
        self._task = self._bars.add_task(part, total=total)

    def step(self, done: int, total: int | None = None) -> None:
        """Show the part's progress."""
        if total is not None:
            self._bars.update(self._task, total=total)
        self._bars.update(self._task, completed=done)

    def pose(self, state: TrackState, overlap: Iterable[float]) -> None:
        """Show the mean overlap, or that there is no pose."""
        known = [value for value in overlap if math.isfinite(value)]
        note = f"overlap {sum(known) / len(known):.2f}" if known else ""
        if state is not TrackState.TRACKING:
            note = state.value
        self._bars.update(self._task, note=note)

    def warn(self, text: str) -> None:
        """Print a warning above the bar."""
        warn(self._bars.console, text)
