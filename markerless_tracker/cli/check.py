"""Verb `check`: finds problems of a recording before tracking."""

import argparse
import json
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from rich.console import Console
from rich.markup import escape

from markerless_tracker.checks.finding import GREEN, RED, YELLOW, Finding
from markerless_tracker.checks.recording import check_recording
from markerless_tracker.cli.terminal.bars import progress_bars
from markerless_tracker.cli.track_arguments import add_format, add_world, reading_options
from markerless_tracker.datasets import open_recording

HELP = (
    "Check a recording before tracking: calibration, cameras in step (by motion alone), background "
    "still the scene, steady light, height of the person in pixels, cameras that see the middle of "
    "the floor. Read are the first 600 frames. Red lines say what to do; exit status 3 if there is "
    "one."
)
EXAMPLE = "markerless_tracker check recordings/walk"
SOMETHING_RED = 3
"""Exit status if a finding is red."""
_MARKS = {GREEN: "[green]ok  [/green]", YELLOW: "[yellow]look[/yellow]", RED: "[red]RED [/red]"}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    parser.add_argument(
        "source", metavar="SOURCE", type=Path, help="recording folder, bag or other recording"
    )
    add_format(parser)
    add_world(parser)
    parser.add_argument("--json", action="store_true", help="print the findings as JSON")


def run(args: argparse.Namespace) -> int:
    """Check; returns 0, or 3 if a finding is red."""
    recording = open_recording(args.source, **reading_options(args))
    with progress_bars() as bars:
        task = bars.add_task(f"reading {recording.name}", total=None)
        found = check_recording(
            recording,
            progress=lambda done, total: bars.update(task, completed=done, total=total),
        )
    return print_findings(found, str(args.source), as_json=args.json)


def print_findings(found: Sequence[Finding], source: str, *, as_json: bool) -> int:
    """Print findings, one line each; returns the exit status: 0, or 3 if a finding is red."""
    red = sum(finding.state == RED for finding in found)
    if as_json:
        summary = {"source": source, "red": red, "findings": [asdict(f) for f in found]}
        json.dump(summary, sys.stdout, indent=2)
        sys.stdout.write("\n")
    else:
        out = Console()
        for finding in found:
            where = f"{finding.camera}: " if finding.camera else ""
            line = f"{finding.check}: {where}{finding.text}"
            advice = f"; {finding.advice}" if finding.advice else ""
            out.print(
                f"{_MARKS[finding.state]} {escape(line + advice)}", highlight=False, soft_wrap=True
            )
        doubted = sum(finding.state == YELLOW for finding in found)
        print(f"{source}: {red} red, {doubted} to look at")
    return SOMETHING_RED if red else 0
