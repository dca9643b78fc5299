"""`benchmark cameras`: the error with every subset of the cameras."""

import argparse
from collections.abc import Iterator
from itertools import groupby
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from markerless_tracker.benchmarks import cameras
from markerless_tracker.benchmarks.tables.runs import LOST_LIMB_MM
from markerless_tracker.benchmarks.with_truth import Report, RunStart
from markerless_tracker.cli.benchmark.arguments import add_kind
from markerless_tracker.cli.benchmark.recordings import Row, add_recordings, run_each, settings
from markerless_tracker.cli.terminal.arguments import count, list_of
from markerless_tracker.errors import ConfigError

_STARTS = ("measured", "automatic")


def add_parser(kinds: "argparse._SubParsersAction[Any]") -> None:
    """Declare the arguments."""
    parser = add_kind(
        kinds,
        "cameras",
        "markerless_tracker benchmark cameras WALK --stature 1.72",
        help="error with every subset of the cameras, and its ratio to that of all cameras",
        description="Whole runs with all cameras and with every subset of the given sizes.",
    )
    add_recordings(parser, without="unknown; only for automatic starts")
    parser.add_argument(
        "--each", type=list_of(count), default=(3, 2), metavar="LIST",
        help="sizes of the subsets (3,2)",
    )  # fmt: skip
    parser.add_argument(
        "--start", type=list_of(str), default=_STARTS, metavar="LIST",
        help="measured: start and lengths from the first row of ground_truth.trc; automatic: only "
        f"--stature is given, scored after {cameras.SETTLED_FRAMES} frames (both)",
    )  # fmt: skip
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="of all random draws (0)")


def run(args: argparse.Namespace) -> int:
    """Measure and print; returns the exit status."""
    unknown = sorted(set(args.start) - set(_STARTS))
    if unknown:
        raise ConfigError(
            f"--start: got {', '.join(unknown)}, expected some of {', '.join(_STARTS)}"
        )
    if args.stature and "automatic" not in args.start:
        raise ConfigError("--stature is given for measured starts, expected --start automatic")
    config = settings(args, "seed")

    def measure(source: Path, stature_m: float | None, scale: float, report: Report) -> Row:
        return cameras.measure_cameras(
            source,
            config,
            starts=[RunStart(name == "measured", stature_m) for name in args.start],
            counts=args.each,
            scale=scale,
            report=report,
        )

    return run_each(args, measure, _show, width=150)


def _show(console: Console, rows: list[Row]) -> None:
    for row in rows:
        console.print(_table(row))
        for line in _summary(row):
            console.print(line, highlight=False, markup=False)


def _table(row: Row) -> Table:
    table = Table(title=f"{row['recording']}, scale {row['scale']:g}: fewer cameras")
    for title in ("start", "cameras"):
        table.add_column(title)
    for title in (
        "mean mm", "x all", "max frame", "worst joint", f"> {LOST_LIMB_MM:g} mm", "found"
    ):  # fmt: skip
        table.add_column(title, justify="right")
    for one in row["runs"]:
        table.add_row(
            one["start"],
            " ".join(one["cameras"]),
            *(_number(one[key], form) for key, form in (
                ("mean_mm", ".1f"), ("ratio", ".2f"), ("max_mm", ".1f"), ("worst_joint_mm", ".0f")
            )),
            str(one["lost_run"]),
            f"{one['found']:.0%}",
        )  # fmt: skip
    return table


def _summary(row: Row) -> Iterator[str]:
    """A line per start and size of the subsets: mean, best and worst."""

    def key(one: dict[str, Any]) -> tuple[str, int]:
        return one["start"], len(one["cameras"])

    for (start, number), group in groupby(row["runs"], key):
        ratios = [one["ratio"] for one in group if one["ratio"] is not None]
        if ratios:
            yield (
                f"{start}, {number} cameras: {sum(ratios) / len(ratios):.2f} times the error of "
                f"all on average, best {min(ratios):.2f}, worst {max(ratios):.2f}"
            )


def _number(value: float | None, form: str) -> str:
    return "-" if value is None else f"{value:{form}}"
