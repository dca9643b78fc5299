"""Progress and warnings of a run of `track`."""

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

COMPILING = "compiling"
"""Name of the part of a run in which kernels are compiled or loaded."""


class Notices:
    """Receives what happens during `track_source`; the base class ignores it."""

    def begin(self, part: str, total: int | None = None) -> None:
        """Receives the name of the next part and the number of its steps (None = unknown)."""

    def step(self, done: int, total: int | None = None) -> None:
        """Receives the number of the part's completed steps, and their total if it changed."""

    def warn(self, text: str) -> None:
        """Receives a warning, one line."""


class Bars(Notices):
    """A progress bar from the first part on, and warnings above it."""

    def __init__(self, console: Console) -> None:
        self._bars = Progress(
            TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(),
            TimeRemainingColumn(), console=console,
        )  # fmt: skip
        self._task = self._bars.add_task("", total=None)

    def __enter__(self) -> "Bars":
        return self

    def __exit__(self, *error: object) -> None:
        if self._bars.live.is_started:
            self._bars.stop()

    def begin(self, part: str, total: int | None = None) -> None:
        """Show the next part."""
        self._bars.start()
        self._bars.reset(self._task, description=part, total=total)

    def step(self, done: int, total: int | None = None) -> None:
        """Show the part's progress."""
        if total is not None:
            self._bars.update(self._task, total=total)
        self._bars.update(self._task, completed=done)

    def warn(self, text: str) -> None:
        """Print a warning above the bar."""
        warn(self._bars.console, text)


def warn(console: Console, text: str) -> None:
    """Print a warning, one line."""
    tell(console, f"warning: {text}")


def tell(console: Console, text: str) -> None:
    """Print a line as it is, whatever the width."""
    console.print(text, markup=False, highlight=False, soft_wrap=True)
