"""`benchmark silhouettes`: masks against exact ones, compared with OpenCV's subtractors."""

import argparse
import json
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from markerless_tracker.cli.benchmark.arguments import add_kind
from markerless_tracker.cli.terminal.arguments import count
from markerless_tracker.cli.terminal.bars import progress_bars
from markerless_tracker.cli.track import read_config
from markerless_tracker.errors import ConfigError
from markerless_tracker.imaging import Image
from markerless_tracker.tracking import TrackerConfig


def add_parser(kinds: "argparse._SubParsersAction[Any]") -> None:
    """Declare the arguments."""
    parser = add_kind(
        kinds,
        "silhouettes",
        "markerless_tracker benchmark silhouettes WALK --pictures masks",
        help="masks against exact ones, compared with OpenCV's MOG2 and KNN",
        description=(
            "Silhouettes against a recording's masks/ or, without masks, against the body posed at "
            "its ground_truth.trc; compared with OpenCV's MOG2 and KNN on the same frames, with "
            "the same morphology, one thread each."
        ),
    )
    parser.add_argument(
        "sources", nargs="*", type=Path, metavar="SOURCE",
        help="recording; default: a made-up walk, 4 x 656x490",
    )  # fmt: skip
    parser.add_argument(
        "--generated", choices=("development", "test"),
        help="40 generated rooms, people and clothes instead; nothing may be set by `test`",
    )  # fmt: skip
    parser.add_argument(
        "--scenes", type=count, metavar="N", help="only the first N generated scenes"
    )
    parser.add_argument(
        "--frames", type=count, metavar="N",
        help="at most N frames, evenly spread (all with exact masks; 10 with markers); of made-up "
        "scenes every sixth (10), of generated ones every 40th (3)",
    )  # fmt: skip
    parser.add_argument("--config", type=Path, metavar="FILE", help="settings (YAML)")
    parser.add_argument(
        "--scale", type=float, default=1.0, metavar="S", help="factor for the images"
    )
    parser.add_argument(
        "--pictures", type=Path, metavar="DIR",
        help="write RECORDING-CAMERA-FRAME.png: false positives red, false negatives blue, "
        "undecided yellow, the rest green",
    )  # fmt: skip
    parser.add_argument(
        "--json", action="store_true", help="print JSON (a list for several recordings)"
    )


def run(args: argparse.Namespace) -> int:
    """Measure and print; returns the exit status."""
    # Imported late, since `--help` does not need it.
    from markerless_tracker.benchmarks.silhouettes.masks import measure
    from markerless_tracker.benchmarks.silhouettes.scene import made_up_scene, recorded_scene
    from markerless_tracker.datasets import write_image

    config = read_config(args.config, {})
    if args.generated is not None:
        return _run_generated(args, config)
    if args.scenes is not None:
        raise ConfigError("--scenes is given without --generated, expected both")
    if not args.sources and args.scale != 1.0:
        raise ConfigError("--scale is given without a SOURCE, expected both")
    results = []
    with progress_bars() as bars:
        for source in args.sources or (None,):
            task = bars.add_task("made up" if source is None else source.name, total=None)
            if source is None:
                scene = made_up_scene(**({} if args.frames is None else {"frames": args.frames}))
            else:
                scene = recorded_scene(source, scale=args.scale, frames=args.frames)

            def picture(camera: str, frame: int, image: Image, name: str = scene.name) -> None:
                name = name.replace(" ", "_")
                write_image(args.pictures / f"{name}-{camera}-{frame:06d}.png", image)

            def progress(done: int, total: int, task: Any = task) -> None:
                bars.update(task, completed=done, total=total)

            results.append(
                measure(
                    scene, config, progress=progress, picture=picture if args.pictures else None
                )
            )
    if args.json:
        json.dump(results[0] if len(results) == 1 else results, sys.stdout, indent=2)
        sys.stdout.write("\n")
        return 0
    console = Console(width=None if sys.stdout.isatty() else 100)
    for figures in results:
        console.print(silhouette_table(figures))
    return 0


def _run_generated(args: argparse.Namespace, config: TrackerConfig) -> int:
    from markerless_tracker.benchmarks.silhouettes.generated import FRAMES, measure_generated
    from markerless_tracker.datasets import write_image

    if args.sources or args.scale != 1.0:
        raise ConfigError("--generated makes its own scenes: expected no SOURCE and no --scale")

    def picture(name: str) -> Callable[[str, int, Image], None]:
        stem = name.replace(" ", "_")
        return lambda camera, frame, image: write_image(
            args.pictures / f"{stem}-{camera}-{frame:06d}.png", image
        )

    with progress_bars() as bars:
        task = bars.add_task(f"generated {args.generated}", total=None)
        figures = measure_generated(
            args.generated,
            config,
            scenes=args.scenes,
            frames=args.frames or FRAMES,
            progress=lambda done, total: bars.update(task, completed=done, total=total),
            picture=picture if args.pictures else None,
        )
    if args.json:
        json.dump(figures, sys.stdout, indent=2)
        sys.stdout.write("\n")
    else:
        console = Console(width=None if sys.stdout.isatty() else 100)
        console.print(generated_table(figures))
    return 0


def generated_table(figures: Mapping[str, Any]) -> Table:
    """The figures of `benchmarks.silhouettes.generated.measure_generated` for people."""
    table = Table(title=f"{figures['recording']}, {len(figures['scenes'])} scenes")
    headings = ["IoU", "of the motion", "of the posture", "shadow leak", "undecided"]
    headings += ["IoU, imaging", "undecided, imaging", "MOG2", "KNN"]
    for heading in ("seed", "motion", "posture", *headings):
        table.add_column(heading, justify="left" if heading in ("motion", "posture") else "right")
    for row in figures["scenes"]:
        leak = [camera["shadow_leak"] for camera in row["cameras"].values()]
        values = [row["iou_mean"], row["motion_iou"], row["posture_iou"], sum(leak) / len(leak)]
        values += [row["undecided_share"], *row["imaging"].values()]
        values += [row["opencv"][name]["iou_mean"] for name in ("mog2", "knn")]
        cells = (f"{value:.3f}" for value in values)
        table.add_row(str(row["seed"]), row["motion"], row["posture"], *cells)
    table.add_section()
    for label, value in (("median", figures["iou_median"]), ("mean", figures["iou_mean"]),
                         (f"worst, {figures['worst_seed']}", figures["iou_worst"])):  # fmt: skip
        table.add_row(label, "", "", f"{value:.3f}")
    return table


def silhouette_table(figures: Mapping[str, Any]) -> Table:
    """The figures of `benchmarks.silhouettes.masks.measure` for people."""
    width, height = figures["image_size"]
    frames = len(figures["frames"])
    title = f"{figures['recording']}, {width}x{height} px, {frames} frames"
    if figures["exact"]:
        columns = {"iou": "IoU", "precision": "precision", "recall": "recall"}
        columns["shadow_leak"] = "shadow leak"
        mean = "iou_mean"
    else:
        title += f"; against the body {figures['body']['name']} at the reference"
        columns = {"overlap": "overlap", "overlap_selected": "overlap, its components"}
        mean = "overlap_mean"
    table = Table(title=title)
    table.add_column("")
    for heading in (*columns.values(), "undecided", "ms"):
        table.add_column(heading, justify="right")
    for name, row in figures["cameras"].items():
        cells = (f"{row[key]:.3f}" for key in columns)
        table.add_row(name, *cells, "", f"{row['ms']:.1f}")
    blank = [""] * (len(columns) - 1)
    table.add_section()
    share = f"{figures['undecided_share']:.3f}"
    table.add_row("mean", f"{figures[mean]:.3f}", *blank, share, f"{figures['ms']:.1f}")
    if "imaging" in figures:
        before = figures["imaging"]
        share = f"{before['undecided_share']:.3f}"
        table.add_row("imaging alone", f"{before['iou_mean']:.3f}", *blank, share, "")
    for key, label in (("mog2", "OpenCV MOG2"), ("knn", "OpenCV KNN")):
        row = figures["opencv"][key]
        table.add_row(label, f"{row[mean]:.3f}", *blank, "", f"{row['ms']:.1f}")
    return table
