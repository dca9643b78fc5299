"""Verb `convert`: writes a recording as a bag."""

import argparse
import json
import sys
import time
from pathlib import Path
from typing import Any

from rich.console import Console

from markerless_tracker.bags import COMPRESSIONS, BagSummary, write_bag
from markerless_tracker.cli.terminal.bars import progress_bars, warn
from markerless_tracker.cli.track_arguments import add_format, add_world, reading_options
from markerless_tracker.datasets import FORMATS, Recording, every_for_fps, open_recording
from markerless_tracker.datasets.empty_scene import backgrounds_of
from markerless_tracker.datasets.part import PartRecording

HELP = (
    "Write a recording folder, a data set, a project of another tool or another bag as an MCAP bag "
    "folder: images, camera infos, static transforms and reference markers as topics, "
    "calibration.toml and background/ in the folder. For a camera without an empty-scene image, "
    "one is learned from the recording."
)
EXAMPLE = "markerless_tracker convert recordings/walk walk_bag --scale 0.5"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    parser.add_argument(
        "source",
        metavar="SOURCE",
        type=Path,
        help=f"recording: {', '.join(FORMATS)} (see bags/README.md)",
    )
    parser.add_argument("bag", metavar="BAG", type=Path, help="folder to write (new or empty)")
    add_format(parser)
    add_world(parser)
    parser.add_argument(
        "--fps",
        type=float,
        metavar="N",
        help="keep every k-th set, from the first kept, to get this rate (default: all)",
    )
    parser.add_argument(
        "--scale",
        type=float,
        default=1.0,
        metavar="S",
        help="scale factor of the images (default 1)",
    )
    parser.add_argument(
        "--compress",
        choices=COMPRESSIONS,
        default="none",
        help="none (default); zstd or png (lossless, smaller, slower); jpeg (lossy, much smaller)",
    )
    parser.add_argument(
        "--cameras", metavar="A,B,...", help="names of the cameras to keep (default: all)"
    )
    parser.add_argument(
        "--start",
        type=float,
        default=0.0,
        metavar="S",
        help="leave out the first S seconds (default 0)",
    )
    parser.add_argument(
        "--end",
        type=float,
        metavar="S",
        help="leave out what is later than S seconds after the first set (default: nothing)",
    )
    parser.add_argument("--force", action="store_true", help="replace an earlier bag at BAG")
    parser.add_argument("--json", action="store_true", help="print a summary as JSON")


def run(args: argparse.Namespace) -> int:
    """Convert; returns the exit status."""
    started = time.monotonic()
    console = Console(stderr=True)
    recording = open_recording(args.source, scale=args.scale, **reading_options(args))
    start = 0
    if args.cameras is not None or args.start != 0.0 or args.end is not None:
        names = None if args.cameras is None else [n for n in args.cameras.split(",") if n]
        part = PartRecording(recording, cameras=names, from_s=args.start, until_s=args.end)
        recording, start = part, part.first
    every = every_for_fps(recording.fps, args.fps)
    with progress_bars(console) as bars:
        task = bars.add_task("background", total=None)
        backgrounds = backgrounds_of(recording)
        bars.update(task, description=f"writing {args.bag.name}")
        summary = write_bag(
            recording,
            args.bag,
            start=start,
            every=every,
            compress=args.compress,
            backgrounds=backgrounds,
            replace=args.force,
            progress=lambda done, total: bars.update(task, completed=done, total=total),
        )
    for warning in recording.warnings:
        warn(console, warning)
    report = _report(recording, summary, args, every, time.monotonic() - started)
    if args.json:
        json.dump(report, sys.stdout, indent=2)
        sys.stdout.write("\n")
    else:
        sizes = ", ".join(f"{name} {w}x{h}" for name, (w, h) in report["size_px"].items())
        print(
            f"{summary.path}: {summary.sets} sets at {report['fps']:g} fps, {sizes}, "
            f"{summary.bytes / 1e6:.1f} MB"
        )
    return 0


def _report(
    recording: Recording,
    summary: BagSummary,
    args: argparse.Namespace,
    every: int,
    seconds: float,
) -> dict[str, Any]:
    return {
        "source": str(args.source),
        "bag": str(summary.path),
        "cameras": list(recording.rig.names),
        "size_px": {camera.name: list(camera.size_px) for camera in recording.rig},
        "frames": summary.sets,
        "fps": recording.fps / every,
        "first_ns": summary.first_ns,
        "last_ns": summary.last_ns,
        "scale": args.scale,
        "compress": args.compress,
        "bytes": summary.bytes,
        "seconds": round(seconds, 3),
        "warnings": list(recording.warnings),
    }
