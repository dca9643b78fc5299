"""The table of a batch's results."""

import io
from pathlib import Path

from rich.console import Console

from markerless_tracker.cli.batch.table import text_table
from markerless_tracker.cli.batch.trial import Trial, failed


def test_names_with_brackets_are_shown_whole() -> None:
    row = failed(Trial("take [final]", Path("/a"), Path("/b"), "", {}), "no [bold] text")
    console = Console(width=120, record=True, file=io.StringIO())
    console.print(text_table([row]))
    text = console.export_text()
    assert "take [final]" in text and "no [bold] text" in text
