"""`benchmark tables`: error in mm on recordings whose truth is known."""

import argparse
import itertools
import json
import sys
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from markerless_tracker.cli.benchmark.arguments import (
    count,
    list_of,
    not_negative,
    positive,
    progress_bars,
)
from markerless_tracker.cli.track import read_config
from markerless_tracker.evaluation import tables
from markerless_tracker.evaluation.machine import machine, usable_cores
from markerless_tracker.evaluation.result import versions
from markerless_tracker.evaluation.runs import LOST_LIMB_MM
from markerless_tracker.tracking import PRESETS, TrackerConfig


def add_parser(kinds: "argparse._SubParsersAction[Any]") -> None:
    """Declare the arguments."""
    parser = kinds.add_parser(
        "tables",
        help="error in mm: presets x optimizers x bodies x refinements x rates x seeds",
        description="Error on recordings whose truth is known, mean and sd over seeds.",
        epilog="example: markerless_tracker benchmark tables RECORDING --truth-score -o out/tables",
    )
    parser.add_argument("sources", nargs="+", type=Path, metavar="SOURCE", help="recording")
    parser.add_argument(
        "--preset", type=list_of(str), metavar="LIST", help="default: tuned,paper (or --config's)"
    )
    parser.add_argument(
        "--optimizer", type=list_of(str), metavar="LIST", help="default: sppso (or --config's)"
    )
    parser.add_argument("--body", type=list_of(str), metavar="LIST", help="default: the preset's")
    parser.add_argument(
        "--refinement",
        type=list_of(str),
        metavar="LIST",
        help="contour,none; default: the preset's",
    )
    parser.add_argument(
        "--fps", type=list_of(positive), default=(), metavar="LIST",
        help="rates; default: 60,20 as far as the recording has them",
    )  # fmt: skip
    parser.add_argument("--seeds", type=count, default=6, metavar="N", help="seeds 0..N-1 (6)")
    parser.add_argument(
        "--evaluations",
        type=count,
        metavar="N",
        help="evaluations per frame (default: each optimizer's own)",
    )
    parser.add_argument("--config", type=Path, metavar="FILE", help="settings (YAML)")
    parser.add_argument(
        "--scale", type=float, default=1.0, metavar="S", help="factor for the images"
    )
    parser.add_argument(
        "--start-noise", type=not_negative, default=0.0, metavar="MM",
        help="sd of normal noise on each coordinate of the first markers",
    )  # fmt: skip
    parser.add_argument(
        "--truth-score", action="store_true", help="also f(truth) - f(result), mean over frames"
    )
    parser.add_argument(
        "--frames", type=count, metavar="N", help="only the recording's first N frames"
    )
    parser.add_argument(
        "--jobs", type=count, default=usable_cores(), metavar="N",
        help="runs side by side (default: one per core)",
    )  # fmt: skip
    parser.add_argument(
        "-o", dest="out", type=Path, metavar="DIR",
        help="write table.csv, table.json and a file per run, which is not repeated next time",
    )  # fmt: skip
    parser.add_argument("--json", action="store_true", help="print the table as JSON")


def run(args: argparse.Namespace) -> int:
    """Make the tables, print and write them; returns the exit status."""
    plan = tables.Plan(
        configs=_configs(args),
        rates=args.fps,
        seeds=args.seeds,
        scale=args.scale,
        start_noise_mm=args.start_noise,
        truth_score=args.truth_score,
        frames=args.frames,
        jobs=args.jobs,
    )
    if args.out is not None:
        args.out.mkdir(parents=True, exist_ok=True)
    with _Bars() as bars:
        rows = tables.make_table(args.sources, plan, store=args.out, progress=bars)
    table = {
        "machine": machine(),
        "versions": versions(),
        "jobs": args.jobs,
        "frames_limit": args.frames,
        "rows": rows,
    }
    if args.out is not None:
        tables.write_table(args.out, table)
    if args.json:
        json.dump(table, sys.stdout, indent=2, allow_nan=False)
        sys.stdout.write("\n")
        return 0
    console = Console(width=None if sys.stdout.isatty() else 200)
    for recording in dict.fromkeys((row["recording"], row["scale"]) for row in rows):
        own = [row for row in rows if (row["recording"], row["scale"]) == recording]
        console.print(_rendered(*recording, own, args))
    console.print(
        "mm; mean and limbs: mean ± sd over the seeds; largest frame mean, worst joint, worst "
        "joint of the last frame and frames in a row with a joint more than "
        f"{LOST_LIMB_MM:g} mm off: the worst seed's. Evaluations of the swarm and "
        "iterations of refinement are per frame; frames/s: one thread, evidence ready.",
        highlight=False,
    )
    return 0


def _configs(args: argparse.Namespace) -> tuple[TrackerConfig, ...]:
    """A configuration per combination of the lists; what is not named keeps its value."""
    presets: tuple[str | None, ...] = args.preset or (
        tuple(PRESETS) if args.config is None else (None,)
    )
    choices = itertools.product(
        presets, args.optimizer or (None,), args.body or (None,), args.refinement or (None,)
    )
    return tuple(
        read_config(
            args.config,
            {
                key: value
                for key, value in (
                    ("preset", preset),
                    ("optimizer", optimizer),
                    ("body", body),
                    ("refinement", refinement),
                    ("evaluations", args.evaluations),
                )
                if value is not None
            },
        )
        for preset, optimizer, body, refinement in choices
    )


def _rendered(
    name: str, scale: float, rows: list[dict[str, Any]], args: argparse.Namespace
) -> Table:
    size = "" if scale == 1.0 else f" at scale {scale:g}"
    noise = f", start disturbed by {args.start_noise:g} mm" if args.start_noise else ""
    seeds = f"{args.seeds} seed{'s' if args.seeds > 1 else ''}"
    table = Table(title=f"{name}{size}, {seeds}{noise}")
    for heading in ("preset", "optimizer", "body", "refinement"):
        table.add_column(heading)
    headings = [
        "fps", "frames", "eval.", "iter.", "mean", "max frame", "worst joint", "limbs",
        "last frame", f"> {LOST_LIMB_MM:g} mm", "frames/s",
    ]  # fmt: skip
    if args.truth_score:
        headings.append("f truth-result")
    for heading in headings:
        table.add_column(heading, justify="right")
    for row in rows:
        cells = [
            row["preset"],
            row["optimizer"],
            Path(row["body"]).stem,
            row["refinement"],
            f"{row['fps']:g}",
            str(row["frames"]),
            f"{row['evaluations']:.0f}",
            f"{row['refinements']:.1f}",
            _spread(row["mean_mm"], row["sd_mm"]),
            f"{row['max_mm']:.1f}",
            f"{row['worst_joint_mm']:.0f}",
            _spread(row["limbs_mm"], row["limbs_sd_mm"]),
            f"{row['last_joint_mm']:.0f}",
            str(row["lost_run"]),
            f"{row['frames_per_s']:.1f}",
        ]
        if args.truth_score:
            difference = row["truth_difference"]
            cells.append("-" if difference is None else f"{difference:+.4f}")
        table.add_row(*cells)
    return table


def _spread(mean: float | None, sd: float | None) -> str:
    if mean is None:
        return "-"
    return f"{mean:.1f}" if sd is None else f"{mean:.1f} ± {sd:.1f}"


class _Bars(tables.Progress):
    """Progress on standard error."""

    def __init__(self) -> None:
        self._bars = progress_bars()
        self._runs = self._bars.add_task("runs", total=None)
        self._evidence = self._bars.add_task("evidence", total=None, visible=False)

    def __enter__(self) -> "_Bars":
        self._bars.__enter__()
        return self

    def __exit__(self, *error: Any) -> None:
        self._bars.__exit__(*error)

    def observing(self, recording: str, done: int, total: int | None) -> None:
        self._bars.update(
            self._evidence, description=f"evidence of {recording}", completed=done, total=total,
            visible=done != total,
        )  # fmt: skip

    def running(self, done: int, total: int) -> None:
        self._bars.update(self._runs, completed=done, total=total)

    def warn(self, message: str) -> None:
        self._bars.console.print(
            f"warning: {message}", markup=False, highlight=False, soft_wrap=True
        )
