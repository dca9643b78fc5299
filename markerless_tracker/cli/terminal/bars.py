"""Progress of commands on standard error, if it is a terminal."""

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    Task,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.text import Text

_BAR_WIDTH = 20
"""Columns of a bar. Description, counts, times and note must fit beside it into a line of 80."""


class NoteColumn(ProgressColumn):
    """The field `note` of a task, such as the overlap of the last frame."""

    def render(self, task: Task) -> Text:
        """The note; empty without one."""
        return Text(str(task.fields.get("note", "")))


class _QuietProgress(Progress):
    """Bars that print no empty line if they are hidden, as rich before version 14 does."""

    def stop(self) -> None:
        if not self.disable:
            super().stop()


def progress_bars(console: Console | None = None) -> Progress:
    """Bars with the elapsed time, the remaining time, and a note.

    Nothing is shown if the console is no terminal.

    Args:
        console: default: standard error.
    """
    console = Console(stderr=True) if console is None else console
    return _QuietProgress(
        TextColumn("{task.description}"), BarColumn(_BAR_WIDTH), MofNCompleteColumn(),
        TimeElapsedColumn(), TimeRemainingColumn(), NoteColumn(),
        console=console, disable=not console.is_terminal,
    )  # fmt: skip


def seconds_bar() -> Progress:
    """A bar of a given duration, on standard error; nothing is shown if it is no terminal."""
    console = Console(stderr=True)
    return _QuietProgress(
        TextColumn("{task.description}"), BarColumn(_BAR_WIDTH), TimeRemainingColumn(),
        console=console, disable=not console.is_terminal,
    )  # fmt: skip


def tell(console: Console, text: str) -> None:
    """Print a line without wrapping or markup."""
    console.print(text, markup=False, highlight=False, soft_wrap=True)


def warn(console: Console, text: str) -> None:
    """Print a warning, one line."""
    tell(console, f"warning: {text}")
