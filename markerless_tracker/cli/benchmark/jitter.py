"""`benchmark jitter`: what the filter of the results takes from jitter and costs in time."""

import argparse
import sys
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from markerless_tracker.benchmarks import jitter
from markerless_tracker.benchmarks.judged import Beginning
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
        "jitter",
        help="jitter of who stands and lag of who moves, without and with the filter",
        description="Jitter, lag and error, without and with smoothing: one_euro.",
        epilog="example: markerless_tracker synthesize STAND --motion stand --seconds 3 && "
        "markerless_tracker benchmark jitter STAND WALK",
    )
    add_recordings(parser, without="start and lengths from the first row of the truth")


def run(args: argparse.Namespace) -> int:
    """Measure and print; returns the exit status."""
    flags = {} if args.threads is None else {"threads": args.threads}
    config = read_config(args.config, flags)

    def measure(source: Path, stature_m: float | None, scale: float, report: Report) -> Row:
        beginning = Beginning(stature_m is None, stature_m)
        return jitter.measure_jitter(
            source, config, beginning=beginning, scale=scale, report=report
        )

    rows = measure_each(args, measure)
    if args.json:
        print_json(rows)
        return 0
    console = Console(width=None if sys.stdout.isatty() else 150)
    console.print(_rendered(rows))
    console.print(
        "Jitter: rms of what a joint centre does faster than its mean over "
        f"{jitter.SLOW_S:g} s, the true motion taken off; mean over the joints. Lag: behind the "
        "unfiltered track, frames; worst: of one joint.",
        highlight=False,
    )
    return 0


def _rendered(rows: list[dict[str, Any]]) -> Table:
    table = Table(title="Calm and in time")
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
