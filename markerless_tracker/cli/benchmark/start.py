"""`benchmark start`: how well the tracker starts by itself."""

import argparse
import sys
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from markerless_tracker.benchmarks import starts
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
        "start",
        help="starts without any start pose, from many frames of recordings",
        description="Starts without a start pose, judged by the truth after some frames.",
        epilog="example: markerless_tracker benchmark start WALK BALANCE --stature 1.72,1.70",
    )
    add_recordings(parser)
    parser.add_argument(
        "--every", type=count, default=10, metavar="N", help="a start from each N-th frame (10)"
    )
    parser.add_argument(
        "--frames", type=count, default=10, metavar="N", help="judged in the N-th frame (10)"
    )
    parser.add_argument("--seeds", type=count, default=1, metavar="N", help="seeds 0..N-1 (1)")
    parser.add_argument("--preset", metavar="NAME", help="tuned (default) or paper")
    parser.add_argument("--body", metavar="NAME", help="default: the preset's")


def run(args: argparse.Namespace) -> int:
    """Measure and print; returns the exit status."""
    flags = {key: getattr(args, key) for key in ("preset", "body", "threads")}
    config = read_config(args.config, {k: v for k, v in flags.items() if v is not None})
    plan = starts.StartPlan(config, every=args.every, frames=args.frames, seeds=args.seeds)

    def measure(source: Path, stature_m: float | None, scale: float, report: Report) -> Row:
        return starts.measure_starts(
            source, plan, stature_m=stature_m, scale=scale, progress=report
        )

    rows = measure_each(args, measure)
    if args.json:
        print_json(rows)
        return 0
    console = Console(width=None if sys.stdout.isatty() else 160)
    console.print(_rendered(rows, args.frames))
    console.print(
        f"Error, heading: in frame {args.frames} of each start; reached: mean error of at most "
        f"{starts.REACHED_MM:g} mm; wrong heading: more than {starts.WRONG_HEADING_DEG:g}° off; "
        "turned: changed to the opposite heading on the way.",
        highlight=False,
    )
    return 0


def _rendered(rows: list[dict[str, Any]], frames: int) -> Table:
    table = Table(title=f"Starts without a start pose, judged in frame {frames}")
    table.add_column("recording")
    for title in (
        "stature", "starts", "found", "reached", "mean mm", "median", "worst", "first frame",
        "wrong heading", "turned", "first pose s", "max",
    ):  # fmt: skip
        table.add_column(title, justify="right")
    for row in rows:
        table.add_row(
            row["recording"],
            "unknown" if row["stature_m"] is None else f"{row['stature_m']:g} m",
            str(row["count"]),
            f"{row['found']:.1%}",
            f"{row['reached']:.1%}",
            *(_mm(row[key]) for key in ("mean_mm", "median_mm", "worst_mm", "first_mm")),
            f"{row['wrong_heading']:.1%}",
            f"{row['turned']:.1%}",
            _seconds(row["first_pose_s"]),
            _seconds(row["first_pose_max_s"]),
        )
    return table


def _mm(value: float | None) -> str:
    return "-" if value is None else f"{value:.1f}"


def _seconds(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f}"
