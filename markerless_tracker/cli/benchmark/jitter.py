"""`benchmark jitter`: jitter and lag without and with the filter of the results."""

import argparse
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from markerless_tracker.benchmarks import jitter
from markerless_tracker.benchmarks.with_truth import Report, RunStart
from markerless_tracker.cli.benchmark.arguments import add_kind
from markerless_tracker.cli.benchmark.recordings import Row, add_recordings, run_each, settings


def add_parser(kinds: "argparse._SubParsersAction[Any]") -> None:
    """Declare the arguments."""
    parser = add_kind(
        kinds,
        "jitter",
        "markerless_tracker synthesize STAND --motion stand --seconds 3",
        "markerless_tracker benchmark jitter STAND WALK",
        help="jitter of a standing person and lag of a moving one, without and with the filter",
        description="Jitter, lag and error, without and with smoothing: one_euro.",
    )
    add_recordings(parser, without="start and lengths from the first row of ground_truth.trc")


def run(args: argparse.Namespace) -> int:
    """Measure and print; returns the exit status."""
    config = settings(args)

    def measure(source: Path, stature_m: float | None, scale: float, report: Report) -> Row:
        start = RunStart(stature_m is None, stature_m)
        return jitter.measure_jitter(source, config, start=start, scale=scale, report=report)

    return run_each(args, measure, _show, width=150)


def _show(console: Console, rows: list[Row]) -> None:
    console.print(_table(rows))
    console.print(
        "Jitter: rms of a joint centre's motion about its mean over "
        f"{jitter.SLOW_S:g} s, the true motion subtracted; mean over the joints. Lag: behind the "
        "unfiltered track, frames; worst: largest of one joint.",
        highlight=False,
    )


def _table(rows: list[Row]) -> Table:
    table = Table(title="Jitter and lag")
    for title in ("recording", "start", "smoothing"):
        table.add_column(title)
    for title in (
        "frames", "m/s", "mean mm", "jitter mm", "worst joint", "lag", "worst lag",
    ):  # fmt: skip
        table.add_column(title, justify="right")
    for row in rows:
        for name in jitter.FILTERS:
            figures = row[name]
            table.add_row(
                row["recording"],
                row["start"],
                name,
                str(row["frames"]),
                f"{row['speed_m_s']:.2f}",
                f"{figures['mean_mm']:.1f}",
                f"{figures['jitter_mm']:.2f}",
                f"{figures['worst_jitter_mm']:.1f} ({figures['worst_joint']})",
                f"{figures['lag_frames']:.2f}",
                f"{figures['worst_lag_frames']:.2f}",
            )
    return table
