"""Verb `record`: writes the topics of a running graph to an MCAP bag."""

import argparse
import json
import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from rich.console import Console
from rich.progress import Progress, TextColumn, TimeElapsedColumn

from markerless_tracker.bags.mcap_bag import BagWriter
from markerless_tracker.camera import read_calibration
from markerless_tracker.cli.terminal.arguments import list_of, positive
from markerless_tracker.cli.terminal.bars import warn
from markerless_tracker.errors import DatasetError

HELP = (
    "Record the topics of a running graph to an MCAP bag folder: the tracker's outputs beside the "
    "images, so that Foxglove and RViz replay them together. Ends with Ctrl-C. At most the last "
    "second is lost by a kill. Needs ROS 2. Exit status 3: no message arrived."
)
EXAMPLE = "markerless_tracker record session_bag --calibration calibration.toml"

NOTHING_ARRIVED = 3
"""Exit status if no message arrived."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    parser.add_argument("bag", metavar="BAG", type=Path, help="folder to write (new or empty)")
    parser.add_argument(
        "--topics",
        metavar="A,B,...",
        type=list_of(str),
        help="topics to record (default: all but debug/..., /rosout and /parameter_events)",
    )
    parser.add_argument("--seconds", type=positive, metavar="S", help="end after S seconds")
    parser.add_argument(
        "--calibration",
        type=Path,
        metavar="FILE",
        help="calibration.toml to put beside the bag, for `track`",
    )
    parser.add_argument("--json", action="store_true", help="print the counts as JSON")


def run(args: argparse.Namespace) -> int:
    """Record; returns 0, or 3 if no message arrived."""
    # Only this function imports ROS.
    from markerless_tracker.node.recorder.process import prepare, record
    from markerless_tracker.node.ros.process import StopSignals

    prepare()
    if args.calibration is not None:
        read_calibration(args.calibration)
    console = Console(stderr=True)
    bars = Progress(
        TextColumn("{task.description}"),
        TextColumn("{task.completed:.0f} messages"),
        TimeElapsedColumn(),
        console=console,
        disable=not console.is_terminal,
    )
    with StopSignals() as stop, _new_bag(args.bag, args.calibration) as writer, bars:
        task = bars.add_task(f"recording {args.bag}", total=None)
        counts = record(
            writer,
            stop,
            topics=args.topics,
            seconds=args.seconds,
            progress=lambda messages: bars.update(task, completed=messages),
        )
    total = sum(counts.values())
    silent = [name for name in args.topics or () if not counts.get(f"/{name.strip('/')}")]
    if total and silent:
        warn(console, f"no message came on {', '.join(silent)}")
    if args.json:
        json.dump({"bag": str(args.bag), "messages": total, "topics": counts}, sys.stdout, indent=2)
        sys.stdout.write("\n")
    else:
        for name, count in sorted(counts.items()):
            print(f"{name}: {count}")
        print(f"{args.bag}: {total} messages of {len(counts)} topics")
        if not total:
            warn(console, "no message came: does the graph run, in the same ROS_DOMAIN_ID?")
    return 0 if total else NOTHING_ARRIVED


@contextmanager
def _new_bag(folder: Path, calibration: Path | None) -> Iterator[BagWriter]:
    """A bag in a new or empty folder; without a message no files are left.

    Raises:
        DatasetError: the folder is not empty.
    """
    existed = folder.exists()
    if existed and (not folder.is_dir() or any(folder.iterdir())):
        raise DatasetError(f"{folder}: exists and is not empty, expected a new or an empty folder")
    folder.mkdir(parents=True, exist_ok=True)
    if calibration is not None:
        shutil.copy(calibration, folder / "calibration.toml")
    writer = BagWriter(folder)
    try:
        with writer:
            yield writer
    finally:
        if not writer.messages:
            for path in folder.iterdir():
                path.unlink()
            if not existed:
                folder.rmdir()
