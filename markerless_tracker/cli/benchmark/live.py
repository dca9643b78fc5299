"""`benchmark live`: rate, latency and CPU time of a tracker that runs as a node."""

import argparse
import json
import sys
from collections.abc import Mapping, Sequence
from typing import Any

from rich.console import Console
from rich.table import Table

from markerless_tracker.benchmarks.machine import machine
from markerless_tracker.cli.benchmark.arguments import add_kind
from markerless_tracker.cli.benchmark.recordings import add_recordings, each, settings
from markerless_tracker.cli.replay.measure import LivePlan, measure_live
from markerless_tracker.cli.terminal.arguments import list_of, positive
from markerless_tracker.cli.terminal.bars import progress_bars
from markerless_tracker.datasets.truth import truth_path
from markerless_tracker.errors import ConfigError
from markerless_tracker.node.ros.process import require_ros
from markerless_tracker.results.result import versions

_WIDTH = 175


def add_parser(kinds: "argparse._SubParsersAction[Any]") -> None:
    """Declare the arguments."""
    parser = add_kind(
        kinds,
        "live",
        "markerless_tracker benchmark live WALK --rates 60,30",
        help="rate, latency, error and CPU time live over ROS 2",
        description=(
            "Recordings as bags, played at several rates to a running tracker: player and tracker "
            "are processes of their own, connected by ROS 2."
        ),
    )
    add_recordings(parser, without="unknown; only for automatic starts")
    parser.add_argument(
        "--rates", type=list_of(positive), default=(60.0, 30.0), metavar="LIST",
        help="sets per second at which the recordings are played (60,30)",
    )  # fmt: skip
    parser.add_argument(
        "--nothing-given",
        action="store_true",
        help="find the person automatically; default: start with the first row of "
        "ground_truth.trc where there is one",
    )


def run(args: argparse.Namespace) -> int:
    """Measure and print; returns the exit status.

    Raises:
        ConfigError: a stature is given, but every recording has a start.
        RosMissingError: ROS 2 is not installed.
    """
    started = not args.nothing_given and all(truth_path(s).is_file() for s in args.sources)
    if args.stature and started:
        raise ConfigError(
            "--stature is given for starts with ground_truth.trc, expected --nothing-given"
        )
    require_ros()
    plan = LivePlan(settings(args), args.rates, start_given=not args.nothing_given)
    statures = each(args.stature or (None,), args.sources, "--stature")
    scales = each(args.scale, args.sources, "--scale")
    rows: list[dict[str, Any]] = []
    with progress_bars() as bars:
        task = bars.add_task("reading", total=None)

        def report(part: str, done: int, total: int | None) -> None:
            bars.update(task, description=part, completed=done, total=total)

        for source, stature_m, scale in zip(args.sources, statures, scales, strict=True):
            rows += measure_live(source, plan, stature_m=stature_m, scale=scale, report=report)
    if args.json:
        table = {"machine": machine(), "versions": versions(), "runs": rows}
        json.dump(table, sys.stdout, indent=2, allow_nan=False)
        sys.stdout.write("\n")
    else:
        console = Console(width=None if sys.stdout.isatty() else _WIDTH)
        console.print(_table(rows))
        load = machine()["load"]
        console.print(
            "Tracked: sets with a pose; a second: of playing time. Latency: from the arrival of a "
            "set's last image to its result. CPU: tracker per tracked set, player per set sent. "
            "Before each run: time of a view-evaluation of the reference on one core, and what all "
            "cores do at once, as a multiple of what one does. "
            f"Load of the machine: {'-' if load is None else load}.",
            highlight=False,
        )
    return 0


def _table(rows: Sequence[Mapping[str, Any]]) -> Table:
    table = Table(title="Live over ROS 2")
    for title in ("recording", "start"):
        table.add_column(title)
    for title in (
        "sets/s", "sets", "played s", "tracked", "a second", "first pose s", "latency ms", "p95",
        "CPU tracker", "CPU player", "mean mm", "reference µs", "cores at once",
    ):  # fmt: skip
        table.add_column(title, justify="right")
    for row in rows:
        table.add_row(
            row["source"],
            row["start"],
            f"{row['rate']:g}",
            str(row["sets"]),
            _number(row["played_s"], 2),
            str(row["tracked"]),
            _number(row["per_second"], 1),
            _number(row["first_pose_s"], 2),
            _number(row["latency_ms"]["median"], 0),
            _number(row["latency_ms"]["p95"], 0),
            _number(row["cpu_ms"]["tracker"], 1),
            _number(row["cpu_ms"]["player"], 1),
            _number(row["mean_mm"], 1),
            _number(row["reference_us"], 0),
            _number(row["cores_at_once"], 2),
        )
    return table


def _number(value: float | None, digits: int) -> str:
    return "-" if value is None else f"{value:.{digits}f}"
