"""Verb `benchmark`: measured tables of accuracy and speed."""

import argparse

from markerless_tracker.cli.benchmark import (
    cameras,
    jitter,
    live,
    recovery,
    silhouettes,
    speed,
    start,
    tables,
)

HELP = (
    "Measure accuracy (tables), fewer cameras (cameras), automatic starts (start), recovery, "
    "jitter and lag (jitter), silhouettes, speed, or all of it live over ROS 2 (live). "
    "Recordings need a ground_truth.trc; in tables its first row gives the start pose and the "
    "segment lengths, all its rows are the reference."
)
EXAMPLE = "markerless_tracker benchmark tables WALK --fps 60,20 --seeds 6 -o out/tables"

_KINDS = {
    "tables": tables,
    "speed": speed,
    "silhouettes": silhouettes,
    "start": start,
    "recovery": recovery,
    "cameras": cameras,
    "jitter": jitter,
    "live": live,
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    parser.usage = "%(prog)s [-h] KIND ..."
    kinds = parser.add_subparsers(
        dest="kind", required=True, metavar=f"{{{','.join(_KINDS)}}}", prog=parser.prog
    )
    for kind in _KINDS.values():
        kind.add_parser(kinds)


def run(args: argparse.Namespace) -> int:
    """Run the benchmark; returns the exit status."""
    return int(_KINDS[args.kind].run(args))
