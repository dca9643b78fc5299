"""`benchmark recovery`: frames until the person is tracked again after a disturbance."""

import argparse
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from markerless_tracker.benchmarks import recovery
from markerless_tracker.benchmarks.with_truth import Report
from markerless_tracker.cli.benchmark.arguments import add_kind
from markerless_tracker.cli.benchmark.recordings import Row, add_recordings, run_each, settings
from markerless_tracker.cli.terminal.arguments import count


def add_parser(kinds: "argparse._SubParsersAction[Any]") -> None:
    """Declare the arguments."""
    parser = add_kind(
        kinds,
        "recovery",
        "markerless_tracker benchmark recovery WALK --stature 1.72",
        help="frames until the person is tracked again after black views or missing frames",
        description="Black views, missing frames, and frames until the person is tracked again.",
    )
    add_recordings(parser)
    parser.add_argument("--seeds", type=count, default=5, metavar="N", help="seeds 0..N-1 (5)")


def run(args: argparse.Namespace) -> int:
    """Measure and print; returns the exit status."""
    config = settings(args)

    def measure(source: Path, stature_m: float | None, scale: float, report: Report) -> Row:
        return recovery.measure_recovery(
            source, config, stature_m=stature_m, scale=scale, seeds=args.seeds, report=report
        )

    return run_each(args, measure, _show, width=120)


def _show(console: Console, rows: list[Row]) -> None:
    console.print(_table(rows))
    for row in rows:
        measured = {run["disturbance"] for run in row["runs"]}
        left = [one.name for one in recovery.DISTURBANCES if one.name not in measured]
        if left:
            text = f"{row['recording']}: too short, or its rate too low, for: {'; '.join(left)}."
            console.print(text, highlight=False, markup=False)
    console.print(
        "Mean error, mm: undisturbed: of the undisturbed run; meanwhile: of the disturbed frames "
        "that have a pose. Back: the error is at most the undisturbed mean + "
        f"{recovery.TOLERANCE_MM:g} mm, within {recovery.WITHIN_FRAMES} frames.",
        highlight=False,
    )


def _table(rows: list[Row]) -> Table:
    table = Table(title="Recovery")
    for title in ("recording", "disturbance"):
        table.add_column(title)
    for title in (
        "undisturbed mm",
        "runs",
        "meanwhile",
        "back",
        "frames until back",
        "worst after",
    ):
        table.add_column(title, justify="right")
    for row in rows:
        undisturbed = sum(row["undisturbed_mm"]) / len(row["undisturbed_mm"])
        for disturbance in recovery.DISTURBANCES:
            runs = [run for run in row["runs"] if run["disturbance"] == disturbance.name]
            if not runs:
                continue
            meanwhile = [run["meanwhile_mm"] for run in runs if run["meanwhile_mm"] is not None]
            until = [run["frames_until_back"] for run in runs]
            worst = [run["worst_mm"] for run in runs if run["worst_mm"] is not None]
            table.add_row(
                row["recording"],
                disturbance.name,
                f"{undisturbed:.1f}",
                str(len(runs)),
                f"{sum(meanwhile) / len(meanwhile):.1f}" if meanwhile else "-",
                str(sum(run["back"] for run in runs)),
                ", ".join("never" if n is None else str(n) for n in until),
                f"{max(worst):.0f}" if worst else "-",
            )
    return table
