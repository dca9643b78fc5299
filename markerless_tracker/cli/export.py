"""Verb `export`: a result in the formats of other programs."""

import argparse
import json
import sys
from pathlib import Path

from rich.console import Console

from markerless_tracker.cli.terminal.bars import progress_bars, warn
from markerless_tracker.cli.track_arguments import result_name
from markerless_tracker.datasets.markers.sets import MARKER_SETS, names_in
from markerless_tracker.errors import DatasetError
from markerless_tracker.results.export.formats import EXPORTS, MORE_FILES
from markerless_tracker.results.read import ResultReader
from markerless_tracker.results.stored_result import result_names
from markerless_tracker.results.target import path_of

HELP = (
    "Write a result (NAME.trc, NAME.json) as NAME.FORMAT: mot (OpenSim motion, degrees), osim "
    "(OpenSim model of the person with these markers, and NAME.ik.xml, the setup of inverse "
    "kinematics), c3d (mm), bvh (cm), csv (one row per frame and joint), npz (NumPy arrays), trc "
    "(with --names), humaneva.xml (for HumanEva's web evaluation, mm, Z up) or bag (folder "
    "NAME_bag with the node's topics). Axes and origin as in NAME.trc, Y up; a bag is in the world "
    "frame. Frames without a pose are empty; in BVH they repeat the last pose."
)
EXAMPLE = "markerless_tracker export out/walk --to mot,osim,c3d"

BAG = "bag"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    parser.add_argument(
        "name", metavar="NAME", type=result_name, help="NAME of NAME.trc and NAME.json"
    )
    parser.add_argument(
        "--to",
        metavar="FORMAT",
        type=_formats,
        nargs="+",
        required=True,
        help=f"one or more of {', '.join((*EXPORTS, BAG))}, separated by commas or blanks",
    )
    parser.add_argument(
        "-o",
        dest="out",
        type=result_name,
        metavar="OUT",
        help="write OUT.FORMAT (default: NAME.FORMAT)",
    )
    parser.add_argument(
        "--names",
        choices=tuple(MARKER_SETS),
        help="name the markers as this set does and write NAME.SET.FORMAT; markers that the set "
        "lacks keep their names",
    )
    parser.add_argument(
        "--keep-lost",
        action="store_true",
        help="keep the estimates of frames in the states LOST and SEARCHING, as far as the result "
        "has them",
    )
    parser.add_argument("--force", action="store_true", help="replace existing files")
    parser.add_argument("--json", action="store_true", help="print the written files as JSON")


def run(args: argparse.Namespace) -> int:
    """Export; returns the exit status."""
    console = Console(stderr=True)
    name = args.name
    formats = list(dict.fromkeys(entry for several in args.to for entry in several))
    parts = result_names(name)
    jobs: list[tuple[Path, Path, str]] = []
    for part in parts:
        base = (args.out or name).with_name((args.out or name).name + part.name[len(name.name) :])
        if args.names is not None:
            base = base.with_name(f"{base.name}.{args.names}")
        jobs += [(part, _path(base, kind), kind) for kind in formats]
    for part, path, kind in jobs:
        if kind == "trc" and path.resolve() == path_of(part, ".trc").resolve():
            raise DatasetError(f"{path}: this is the result, expected --names or another -o")
    if not args.force:
        _refuse_existing(jobs)
    written, notes = [], []
    with progress_bars(console) as bars:
        for part, path, kind in bars.track(jobs, description=f"exporting {name.name}"):
            reader = ResultReader(part, keep_lost=args.keep_lost)
            path.parent.mkdir(parents=True, exist_ok=True)
            if kind == BAG:
                # Imported late, since the import of rosbags is slow.
                from markerless_tracker.bags.results import write_result_bag

                write_result_bag(path, reader, replace=args.force)
            else:
                names = reader.marker_names
                if args.names is not None:
                    names = names_in(args.names, names)
                notes += EXPORTS[kind](path, reader, names)
            more = (path.with_suffix(ending) for ending in MORE_FILES.get(kind, ()))
            written += [path, *(other for other in more if other.exists())]
    for note in notes:
        warn(console, note)
    if args.json:
        json.dump(
            {"files": [str(path) for path in written], "warnings": notes}, sys.stdout, indent=2
        )
        sys.stdout.write("\n")
    else:
        for path in written:
            print(path)
    return 0


def _formats(text: str) -> list[str]:
    found = [entry for entry in text.split(",") if entry]
    if not found:
        raise argparse.ArgumentTypeError(
            f"{text!r} names no format, expected some of {', '.join((*EXPORTS, BAG))}"
        )
    for entry in found:
        if entry not in (*EXPORTS, BAG):
            raise argparse.ArgumentTypeError(
                f"format {entry!r}, expected some of {', '.join((*EXPORTS, BAG))}"
            )
    return found


def _path(base: Path, kind: str) -> Path:
    # Readers assume that a name ending in .bag is a bag of ROS 1.
    return base.with_name(f"{base.name}{'_' if kind == BAG else '.'}{kind}")


def _refuse_existing(jobs: list[tuple[Path, Path, str]]) -> None:
    for _, path, kind in jobs:
        more = (path.with_suffix(ending) for ending in MORE_FILES.get(kind, ()))
        for target in (path, *more):
            if target.exists():
                raise DatasetError(f"{target}: exists already, expected a new name or --force")
