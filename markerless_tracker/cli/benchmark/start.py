"""`benchmark start`: success and error of automatic starts."""

import argparse
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from markerless_tracker.benchmarks import postures, starts
from markerless_tracker.benchmarks.silhouettes.generated import SETS
from markerless_tracker.benchmarks.with_truth import Report
from markerless_tracker.cli.benchmark.arguments import add_kind
from markerless_tracker.cli.benchmark.recordings import Row, add_recordings, run_each, settings
from markerless_tracker.cli.terminal.arguments import count
from markerless_tracker.errors import ConfigError


def add_parser(kinds: "argparse._SubParsersAction[Any]") -> None:
    """Declare the arguments."""
    parser = add_kind(
        kinds,
        "start",
        "markerless_tracker benchmark start WALK BALANCE --stature 1.72,1.70",
        help="automatic starts from many frames of recordings",
        description="Automatic starts, scored by the ground_truth.trc after some frames.",
    )
    add_recordings(parser, sources="*")
    parser.add_argument(
        "--postures", type=count, metavar="N",
        help="N generated people who squat, bend down, sit, raise or cross their arms instead",
    )  # fmt: skip
    parser.add_argument(
        "--set", choices=tuple(SETS), default="development",
        help="with --postures: their scenes; nothing may be set by `test`",
    )  # fmt: skip
    parser.add_argument(
        "--exact",
        action="store_true",
        help="with --postures: exact silhouettes instead of segmented ones",
    )
    parser.add_argument("--every", type=count, metavar="N", help="start from every N-th frame (10)")
    parser.add_argument(
        "--frames", type=count, default=10, metavar="N", help="scored in the N-th frame (10)"
    )
    parser.add_argument("--seeds", type=count, metavar="N", help="seeds 0..N-1 (1)")
    parser.add_argument("--preset", metavar="NAME", help="tuned (default) or paper")
    parser.add_argument("--body", metavar="NAME", help="default: the preset's")


def run(args: argparse.Namespace) -> int:
    """Measure and print; returns the exit status.

    Raises:
        ConfigError: neither recordings nor `--postures` are given, or both, or options of the
            other.
    """
    if (args.postures is None) == (not args.sources):
        raise ConfigError("expected recordings or --postures N, and not both")
    if args.postures is None and (args.exact or args.set != "development"):
        raise ConfigError("--exact and --set need --postures")
    counts = {key: n for key in ("every", "seeds") if (n := getattr(args, key)) is not None}
    if args.postures is not None and (args.stature or args.scale != (1.0,) or counts):
        raise ConfigError(
            "--postures makes its own scenes, each with one start: expected no --stature, --scale, "
            "--every or --seeds"
        )
    config = settings(args, "preset", "body")
    plan = starts.StartPlan(config, frames=args.frames, **counts)

    def measure(source: Path, stature_m: float | None, scale: float, report: Report) -> Row:
        if args.postures is not None:
            return postures.measure_postures(
                plan, args.postures, which=args.set, exact=args.exact, report=report
            )
        return starts.measure_starts(source, plan, stature_m=stature_m, scale=scale, report=report)

    def show(console: Console, rows: list[Row]) -> None:
        console.print(_table(rows, args.frames))
        for row in rows:
            shares = row.get("postures", {}).items()
            if shares:
                text = ", ".join(f"{name} {share:.0%}" for name, share in shares)
                console.print(f"Succeeded by posture: {text}.", highlight=False)
        console.print(
            f"Error, heading: in frame {args.frames} of each start; succeeded: mean error of at "
            f"most {starts.SUCCESS_MM:g} mm; wrong heading: more than "
            f"{starts.WRONG_HEADING_DEG:g}° off; corrected: changed to the opposite heading.",
            highlight=False,
        )

    if args.postures is not None:
        args.sources = [Path("generated")]
    return run_each(args, measure, show, width=160)


def _table(rows: list[Row], frames: int) -> Table:
    table = Table(title=f"Automatic starts, scored in frame {frames}")
    table.add_column("recording")
    for title in (
        "stature", "starts", "found", "succeeded", "mean mm", "median", "worst", "first frame",
        "wrong heading", "corrected", "first pose s", "max",
    ):  # fmt: skip
        table.add_column(title, justify="right")
    for row in rows:
        table.add_row(
            row["recording"],
            "unknown" if row["stature_m"] is None else f"{row['stature_m']:g} m",
            str(row["count"]),
            f"{row['found']:.1%}",
            f"{row['succeeded']:.1%}",
            *(_mm(row[key]) for key in ("mean_mm", "median_mm", "worst_mm", "first_mm")),
            f"{row['wrong_heading']:.1%}",
            f"{row['heading_corrected']:.1%}",
            _seconds(row["first_pose_s"]),
            _seconds(row["first_pose_max_s"]),
        )
    return table


def _mm(value: float | None) -> str:
    return "-" if value is None else f"{value:.1f}"


def _seconds(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f}"
