"""`benchmark recovery`: how soon the tracker is back after it saw nothing."""

import argparse
import sys
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from markerless_tracker.benchmarks import recovery
from markerless_tracker.cli.benchmark.arguments import count
from markerless_tracker.cli.benchmark.recordings import (
    Report,
    Row,
    add_recordings,
    measure_each,
    print_json,
)
from markerless_tracker.cli.track import read_config


def add_parser(kinds: "argparse._SubParsersAction[Any]") -> None:
    """Declare the arguments."""
    parser = kinds.add_parser(
        "recovery",
        help="how soon the person is tracked again after black views or missing frames",
        description="Black views and missing frames, and how soon the person is tracked again.",
        epilog="example: markerless_tracker benchmark recovery WALK --stature 1.72",
    )
    add_recordings(parser)
    parser.add_argument("--seeds", type=count, default=5, metavar="N", help="seeds 0..N-1 (5)")


def run(args: argparse.Namespace) -> int:
    """Measure and print; returns the exit status."""
    flags = {} if args.threads is None else {"threads": args.threads}
    config = read_config(args.config, flags)

    def measure(source: Path, stature_m: float | None, scale: float, report: Report) -> Row:
        return recovery.measure_recovery(
            source, config, stature_m=stature_m, scale=scale, seeds=args.seeds, progress=report
        )

    rows = measure_each(args, measure)
    if args.json:
        print_json(rows)
        return 0
    console = Console(width=None if sys.stdout.isatty() else 120)
    console.print(_rendered(rows))
    console.print(
        "Mean error, mm: usual: undisturbed; meanwhile: of the disturbed frames that have a pose. "
        f"Back: the error is at most the undisturbed run's mean + {recovery.OVER_USUAL_MM:g} mm, "
        f"within {recovery.WITHIN_FRAMES} frames.",
        highlight=False,
    )
    return 0


def _rendered(rows: list[dict[str, Any]]) -> Table:
    table = Table(title="Recovery")
    for title in ("recording", "disturbance"):
        table.add_column(title)
    for title in ("usual mm", "runs", "meanwhile", "back", "frames until back", "worst after"):
        table.add_column(title, justify="right")
    for row in rows:
        usual = sum(row["usual_mm"]) / len(row["usual_mm"])
        for disturbance in recovery.DISTURBANCES:
            runs = [run for run in row["runs"] if run["disturbance"] == disturbance.name]
            if not runs:
                continue
            meanwhile = [run["meanwhile_mm"] for run in runs if run["meanwhile_mm"] is not None]
            until = [run["frames_until_back"] for run in runs]
            table.add_row(
                row["recording"],
                disturbance.name,
                f"{usual:.1f}",
                str(len(runs)),
                f"{sum(meanwhile) / len(meanwhile):.1f}" if meanwhile else "-",
                str(sum(run["back"] for run in runs)),
                ", ".join("never" if n is None else str(n) for n in until),
                f"{max(run['worst_mm'] for run in runs):.0f}",
            )
    return table
