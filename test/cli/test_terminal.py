"""What verbs show while they work: progress in a terminal, nothing elsewhere; JSON on request."""

import argparse
import io
import json
import math
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from rich.console import Console

from markerless_tracker.cli.main import VERBS, main, parser_of
from markerless_tracker.cli.terminal.bars import progress_bars
from markerless_tracker.cli.terminal.notices import Bars
from markerless_tracker.records import TrackState

CLI = Path(__file__).resolve().parents[2] / "markerless_tracker" / "cli"


def parsers() -> Iterator[tuple[str, argparse.ArgumentParser]]:
    """All verbs, and the kinds of those that have kinds."""
    for verb in VERBS:
        parser = parser_of(verb)
        kinds = [a for a in parser._actions if isinstance(a, argparse._SubParsersAction)]
        for kind in kinds:
            yield from ((f"{verb} {name}", one) for name, one in kind.choices.items())
        if not kinds:
            yield verb, parser


def test_every_verb_prints_json_on_request() -> None:
    found = dict(parsers())
    assert len(found) > len(VERBS)
    assert [name for name, parser in found.items() if "--json" not in parser.format_help()] == []


def test_help_fits_into_80_columns(monkeypatch: pytest.MonkeyPatch) -> None:
    """No line is longer than the terminal; an example is one line per command."""
    monkeypatch.setenv("COLUMNS", "80")
    helps = {verb: parser_of(verb).format_help() for verb in VERBS}
    helps |= {name: parser.format_help() for name, parser in parsers()}
    wide = {(name, line) for name, text in helps.items() for line in text.splitlines() if line[80:]}
    assert wide == set()
    for name, text in helps.items():
        head, colon, lines = text.rpartition("\nexample")[2].partition(":\n")
        assert colon and head in ("", "s"), name
        assert all(line.startswith("  markerless_tracker ") for line in lines.splitlines()), name


def test_a_value_is_named_by_its_meaning_or_unit() -> None:
    """No option's value is named as the option itself: `--fps FPS` says nothing."""
    plain = {
        f"{name} {action.option_strings[-1]}"
        for name, parser in parsers()
        for action in parser._actions
        if action.option_strings and action.nargs != 0
        if action.metavar is None and action.choices is None
    }
    assert plain == set()


def test_where_nothing_is_shown_bars_print_nothing() -> None:
    output = io.StringIO()
    with progress_bars(Console(file=output)) as bars:
        bars.update(bars.add_task("work", total=2), completed=1)
    assert output.getvalue() == ""


def test_bars_are_made_in_one_place() -> None:
    makers = {
        path.relative_to(CLI).as_posix()
        for path in CLI.rglob("*.py")
        if "Progress(" in path.read_text(encoding="utf-8")
    }
    # `record` has no end to show, and `make demo` prints its parts also where no terminal is.
    assert makers == {"terminal/bars.py", "record.py", "demo/__main__.py"}


def test_a_part_of_unknown_length_has_no_total() -> None:
    file = io.StringIO()
    with Bars(Console(file=file, force_terminal=True, width=100, color_system=None)) as bars:
        bars.begin("tracking walk", 10)
        bars.begin("smoothing")
    assert "0/?" in file.getvalue().rpartition("smoothing")[2]


def shown(terminal: bool) -> str:
    """What a run of `track` shows."""
    file = io.StringIO()
    console = Console(file=file, force_terminal=terminal, width=100, color_system=None)
    with Bars(console) as bars:
        bars.begin("tracking walk", 10)
        bars.pose(TrackState.TRACKING, [0.90, 0.80, math.nan])
        bars.step(4)
        bars.warn("frame 3: something")
    return file.getvalue()


def test_a_terminal_shows_count_time_left_and_overlap() -> None:
    text = shown(True)
    assert "tracking walk" in text and "4/10" in text and "overlap 0.85" in text
    assert "-:--:--" in text or "0:00:0" in text


def test_elsewhere_warnings_alone_are_shown() -> None:
    assert shown(False) == "warning: frame 3: something\n"


@pytest.mark.parametrize(
    ("state", "note"), [(TrackState.SEARCHING, "SEARCHING"), (TrackState.LOST, "LOST")]
)
def test_a_frame_without_a_pose_shows_the_state(state: TrackState, note: str) -> None:
    file = io.StringIO()
    with Bars(Console(file=file, force_terminal=True, width=100)) as bars:
        bars.begin("tracking walk", 10)
        bars.pose(state, [])
    assert note in file.getvalue()


def test_bars_fit_into_80_columns() -> None:
    file = io.StringIO()
    with progress_bars(Console(file=file, force_terminal=True, width=80, no_color=True)) as bars:
        bars.add_task("tracking walk", total=18_000, completed=9_000, note="overlap 0.88")
    assert "overlap 0.88" in file.getvalue()


def test_a_command_writes_json_alone_where_no_terminal_is(tmp_path: Path, capsys) -> None:
    words = ["synthesize", str(tmp_path / "made"), "--seconds", "0.04", "--size", "64x48"]
    assert main([*words, "--cameras", "2", "--json"]) == 0
    captured = capsys.readouterr()
    assert json.loads(captured.out)["frames"] == 2
    assert captured.err == ""


def terminal_of(words: list[str], folder: Path) -> tuple[int, str]:
    """Exit status of a command in a terminal of 80 columns, and all that it showed there."""
    pty = pytest.importorskip("pty", reason="no pseudo-terminals")
    ours, theirs = pty.openpty()
    environment = {**os.environ, "TERM": "xterm", "COLUMNS": "80"}
    command = [sys.executable, "-m", "markerless_tracker", *words]
    with subprocess.Popen(
        command, cwd=folder, env=environment, stdin=theirs, stdout=subprocess.PIPE, stderr=theirs
    ) as process:
        os.close(theirs)
        shown = b""
        while True:
            try:
                shown += (piece := os.read(ours, 65536))
            except OSError:  # how a pseudo-terminal ends
                break
            if not piece:
                break
        status = process.wait()
    os.close(ours)
    return status, shown.decode()


def test_boards_are_made_and_searched_with_progress_in_a_terminal(tmp_path: Path) -> None:
    words = ["synthesize", "board", "--checkerboard", "--seconds", "1", "--cameras", "2"]
    status, text = terminal_of([*words, "--size", "164x122"], tmp_path)
    assert status == 0 and "preparing board" in text and "rendering board" in text, text
    assert "10/10" in text
    # A second holds too few places of the board: the error follows the progress.
    status, text = terminal_of(["calibrate", "board", "-o", "c.toml"], tmp_path)
    assert "searching board" in text and "10/10" in text, text
    assert status == 0 or "markerless_tracker: error: " in text
