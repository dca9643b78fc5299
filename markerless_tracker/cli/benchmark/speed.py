"""`benchmark speed`: computing time of each part."""

import argparse
import json
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from markerless_tracker.cli.benchmark.arguments import add_kind
from markerless_tracker.cli.terminal.arguments import count
from markerless_tracker.cli.terminal.bars import progress_bars
from markerless_tracker.errors import ConfigError


def add_parser(kinds: "argparse._SubParsersAction[Any]") -> None:
    """Declare the arguments."""
    parser = add_kind(
        kinds,
        "speed",
        "markerless_tracker benchmark speed --threads 2",
        help="time of each part, and ratios to a fixed reference timed alternately",
        description="Time of each part, and ratios to a fixed reference timed alternately.",
    )
    parser.add_argument(
        "source", nargs="?", type=Path, metavar="SOURCE",
        help="recording with a ground_truth.trc; default: a made-up person, 4 x 644x488",
    )  # fmt: skip
    parser.add_argument(
        "--scale", type=float, default=1.0, metavar="S", help="factor for the images"
    )
    parser.add_argument("--threads", type=int, default=0, metavar="N", help="0 = one per core")
    parser.add_argument("--frames", type=count, default=30, metavar="N", help="frames timed (30)")
    parser.add_argument("--repeats", type=count, default=5, metavar="N", help="minimum of N (5)")
    parser.add_argument("--json", action="store_true", help="print the figures as JSON")


def run(args: argparse.Namespace) -> int:
    """Measure and print; returns the exit status."""
    # Imported late, since `--help` does not need it.
    from markerless_tracker.benchmarks.speed.parts import measure
    from markerless_tracker.benchmarks.speed.scene import made_up_scene, recorded_scene

    if args.source is None and args.scale != 1.0:
        raise ConfigError("--scale is given without a SOURCE, expected both")
    # The first frame fits the shape and is not timed.
    frames = args.frames + 1
    with progress_bars() as bars:
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
        f"{where['cpu']}, {where['cores']} cores, load {where['load']}; "
        f"{figures['threads']} threads; {figures['source']}, "
        f"{figures['cameras']} cameras, {width}x{height} px",
        highlight=False,
        markup=False,
    )
    console.print(speed_table(figures))
    return 0


def speed_table(figures: Mapping[str, Any]) -> Table:
    """The figures of `benchmarks.speed.parts.measure` for people."""
    table = Table()
    table.add_column("part")
    table.add_column("unit")
    table.add_column("", justify="right")
    table.add_column("p95", justify="right")
    view = figures["view_evaluation_us"]
    for label, key in (
        ("view-evaluation, balan31, one thread", "full"),
        ("view-evaluation, person31, one thread", "person31"),
        ("view-evaluation, arm alone, one thread", "limb"),
        ("view-evaluation, arm and torso's joint, one thread", "limb_soft"),
        ("view-evaluation, reference (NumPy, OpenCV)", "reference"),
    ):
        table.add_row(label, "µs", f"{view[key]:.1f}", "")
    table.add_row("reference / balan31", "ratio", f"{figures['reference_ratio']:.1f}", "")
    table.add_row("person31 / balan31", "ratio", f"{figures['person31_ratio']:.2f}", "")
    table.add_row("arm alone / balan31", "ratio", f"{figures['limb_ratio']:.2f}", "")
    table.add_row(
        "arm and torso's joint / balan31", "ratio", f"{figures['limb_soft_ratio']:.2f}", ""
    )
    frame = figures["frame_ms"]
    for label, spread in (
        *((f"swarm alone, balan31: {name}", ms) for name, ms in figures["swarm_ms"].items()),
        ("frame: background", frame["background"]),
        ("frame: edges", frame["edges"]),
        ("frame: images to evidence", frame["imaging"]),
        ("frame: evidence to pose, tuned", frame["fitness"]),
        ("frame: images to pose, tuned", frame["total"]),
        ("1000 evaluations of the tuned body", figures["thousand_evaluations_ms"]),
    ):
        table.add_row(label, "ms", f"{spread['median']:.2f}", f"{spread['p95']:.2f}")
    for name, ratio in figures["swarm_ratio"].items():
        table.add_row(f"{name} / sppso_1000", "ratio", f"{ratio:.2f}", "")
    table.add_row("contour refinement, one iteration", "ms", f"{figures['refine_ms']:.3f}", "")
    table.add_row("contours of a frame", "ms", f"{figures['refine_setup_ms']:.2f}", "")
    ratio = figures["fit_vs_1000_evaluations"]
    table.add_row("evidence to pose / 1000 evaluations", "ratio", f"{ratio:.2f}", "")
    return table
