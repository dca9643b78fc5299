"""Verb `benchmark`: measured tables of accuracy and speed."""

import argparse
import itertools
import json
import math
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.table import Table

from markerless_tracker.cli.track import read_config
from markerless_tracker.evaluation import tables
from markerless_tracker.evaluation.machine import machine, usable_cores
from markerless_tracker.evaluation.result import versions
from markerless_tracker.evaluation.runs import LOST_LIMB_MM
from markerless_tracker.tracking import PRESETS, TrackerConfig

HELP = (
    "Measure accuracy (tables) or speed (speed). Recordings for tables have a ground_truth.trc: "
    "its first row is the start and gives the lengths, its rows are the truth."
)
EXAMPLE = "markerless_tracker benchmark tables RECORDING --fps 60,20 --seeds 6 -o out/tables"

T = TypeVar("T")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    kinds = parser.add_subparsers(dest="kind", required=True, metavar="KIND")
    table = kinds.add_parser(
        "tables",
        help="error in mm: presets x bodies x refinements x rates x seeds",
        description="Error on recordings whose truth is known, mean and sd over seeds.",
        epilog=f"example: {EXAMPLE}",
    )
    table.add_argument("sources", nargs="+", type=Path, metavar="SOURCE", help="recording")
    table.add_argument(
        "--preset", type=_list(str), metavar="LIST", help="default: tuned,paper (or --config's)"
    )
    table.add_argument("--body", type=_list(str), metavar="LIST", help="default: the preset's")
    table.add_argument(
        "--refinement", type=_list(str), metavar="LIST", help="contour,none; default: the preset's"
    )
    table.add_argument(
        "--fps", type=_list(_positive), default=(), metavar="LIST",
        help="rates; default: 60,20 as far as the recording has them",
    )  # fmt: skip
    table.add_argument("--seeds", type=_count, default=6, metavar="N", help="seeds 0..N-1 (6)")
    table.add_argument("--evaluations", type=_count, metavar="N", help="evaluations per frame")
    table.add_argument("--config", type=Path, metavar="FILE", help="settings (YAML)")
    table.add_argument(
        "--scale", type=float, default=1.0, metavar="S", help="factor for the images"
    )
    table.add_argument(
        "--start-noise", type=_noise, default=0.0, metavar="MM",
        help="sd of normal noise on each coordinate of the first markers",
    )  # fmt: skip
    table.add_argument(
        "--truth-score", action="store_true", help="also f(truth) - f(result), mean over frames"
    )
    table.add_argument(
        "--frames", type=_count, metavar="N", help="only the recording's first N frames"
    )
    table.add_argument(
        "--jobs", type=_count, default=usable_cores(), metavar="N",
        help="runs side by side (default: one per core)",
    )  # fmt: skip
    table.add_argument(
        "-o", dest="out", type=Path, metavar="DIR",
        help="write table.csv, table.json and a file per run, which is not repeated next time",
    )  # fmt: skip
    table.add_argument("--json", action="store_true", help="print the table as JSON")
    speed = kinds.add_parser(
        "speed",
        help="time of each part, and ratios to a fixed reference timed in between",
        description="Time of each part, and ratios to a fixed reference timed in between.",
        epilog="example: markerless_tracker benchmark speed --threads 2",
    )
    speed.add_argument(
        "source", nargs="?", type=Path, metavar="SOURCE",
        help="recording with a ground_truth.trc; default: a made-up person, 4 x 644x488",
    )  # fmt: skip
    speed.add_argument(
        "--scale", type=float, default=1.0, metavar="S", help="factor for the images"
    )
    speed.add_argument("--threads", type=int, default=0, metavar="N", help="0 = one per core")
    speed.add_argument("--frames", type=_count, default=30, metavar="N", help="frames timed (30)")
    speed.add_argument("--repeats", type=_count, default=5, metavar="N", help="least of N (5)")
    speed.add_argument("--json", action="store_true", help="print the figures as JSON")


def run(args: argparse.Namespace) -> int:
    """Do it; returns the exit status."""
    return {"tables": _tables, "speed": _speed}[args.kind](args)


def _tables(args: argparse.Namespace) -> int:
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
    """A configuration per preset, body and refinement; what is not named keeps its value."""
    presets: tuple[str | None, ...] = args.preset or (
        tuple(PRESETS) if args.config is None else (None,)
    )
    choices = itertools.product(presets, args.body or (None,), args.refinement or (None,))
    return tuple(
        read_config(
            args.config,
            {
                key: value
                for key, value in (
                    ("preset", preset),
                    ("body", body),
                    ("refinement", refinement),
                    ("evaluations", args.evaluations),
                )
                if value is not None
            },
        )
        for preset, body, refinement in choices
    )


def _rendered(
    name: str, scale: float, rows: list[dict[str, Any]], args: argparse.Namespace
) -> Table:
    size = "" if scale == 1.0 else f" at scale {scale:g}"
    noise = f", start disturbed by {args.start_noise:g} mm" if args.start_noise else ""
    seeds = f"{args.seeds} seed{'s' if args.seeds > 1 else ''}"
    table = Table(title=f"{name}{size}, {seeds}{noise}")
    for heading in ("preset", "body", "refinement"):
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


def _speed(args: argparse.Namespace) -> int:
    # A made-up person is only imported where one is wanted.
    from markerless_tracker.evaluation.speed import measure
    from markerless_tracker.evaluation.speed_scene import made_up_scene, recorded_scene

    # The first frame fits the shape and is not timed.
    frames = args.frames + 1
    with _progress() as bars:
        task = bars.add_task("reading images", total=None)
        if args.source is None:
            scene = made_up_scene(frames=frames)
        else:
            scene = recorded_scene(args.source, frames=frames, scale=args.scale)
        figures = measure(
            scene,
            threads=args.threads,
            repeats=args.repeats,
            progress=lambda part, done, total: bars.update(
                task, description=part, completed=done, total=total
            ),
        )
    if args.json:
        json.dump(figures, sys.stdout, indent=2, allow_nan=False)
        sys.stdout.write("\n")
        return 0
    where = figures["machine"]
    width, height = figures["image_size"]
    console = Console(width=None if sys.stdout.isatty() else 100)
    console.print(
        f"{where['cpu']}, {where['cores']} cores; {figures['threads']} threads; "
        f"{figures['source']}, {figures['cameras']} cameras, {width}x{height} px",
        highlight=False,
        markup=False,
    )
    console.print(speed_table(figures))
    return 0


def speed_table(figures: Mapping[str, Any]) -> Table:
    """The figures of `evaluation.speed.measure` for people."""
    table = Table()
    table.add_column("part")
    table.add_column("unit")
    table.add_column("", justify="right")
    table.add_column("p95", justify="right")
    view = figures["view_evaluation_us"]
    for label, key in (
        ("view-evaluation, balan31, one thread", "full"),
        ("view-evaluation, person31, one thread", "person31"),
        ("view-evaluation, reference (NumPy, OpenCV)", "reference"),
    ):
        table.add_row(label, "µs", f"{view[key]:.1f}", "")
    table.add_row("reference / balan31", "ratio", f"{figures['reference_ratio']:.1f}", "")
    table.add_row("person31 / balan31", "ratio", f"{figures['person31_ratio']:.2f}", "")
    frame = figures["frame_ms"]
    for label, spread in (
        ("fitness and swarm, balan31, 1000 evaluations", figures["swarm_ms"]["sppso_1000"]),
        ("frame: background", frame["background"]),
        ("frame: edges", frame["edges"]),
        ("frame: evidence to pose, tuned", frame["fitness"]),
        ("frame: images to pose, tuned", frame["total"]),
        ("1000 evaluations of the tuned body", figures["thousand_evaluations_ms"]),
    ):
        table.add_row(label, "ms", f"{spread['median']:.2f}", f"{spread['p95']:.2f}")
    table.add_row("contour refinement, one iteration", "ms", f"{figures['refine_ms']:.3f}", "")
    table.add_row("contours of a frame", "ms", f"{figures['refine_setup_ms']:.2f}", "")
    ratio = figures["fit_vs_1000_evaluations"]
    table.add_row("evidence to pose / 1000 evaluations", "ratio", f"{ratio:.2f}", "")
    return table


def _progress() -> Progress:
    return Progress(
        TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(),
        TimeElapsedColumn(), TimeRemainingColumn(), console=Console(stderr=True),
    )  # fmt: skip


class _Bars(tables.Progress):
    """Progress on standard error."""

    def __init__(self) -> None:
        self._bars = _progress()
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


def _list(kind: Callable[[str], T]) -> Callable[[str], tuple[T, ...]]:
    """Parser of a list with commas; a value that stands twice counts once."""

    def parse(text: str) -> tuple[T, ...]:
        words = [word.strip() for word in text.split(",")]
        if not all(words):
            raise argparse.ArgumentTypeError(f"{text!r} is no list with commas between")
        return tuple(dict.fromkeys(kind(word) for word in words))

    return parse


def _count(text: str) -> int:
    try:
        value = int(text)
    except ValueError:
        value = 0
    if value < 1:
        raise argparse.ArgumentTypeError(f"{text!r}, expected a whole number from 1")
    return value


def _positive(text: str) -> float:
    value = _noise(text)
    if value == 0.0:
        raise argparse.ArgumentTypeError(f"{text!r}, expected a number above 0")
    return value


def _noise(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and value >= 0.0):
        raise argparse.ArgumentTypeError(f"{text!r}, expected a number from 0")
    return value
