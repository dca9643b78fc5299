"""Arguments of the verb `track`."""

import argparse
from pathlib import Path
from typing import Any

from markerless_tracker.datasets import FORMATS
from markerless_tracker.datasets.upright.axes import AXES, UNITS
from markerless_tracker.datasets.upright.standing import PERSON
from markerless_tracker.errors import DatasetError
from markerless_tracker.results.smooth import CUTOFF_HZ, LEAST_CUTOFF_HZ
from markerless_tracker.results.target import result_name as name_of
from markerless_tracker.tracking import OPTIMIZERS, PRESETS


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments, in groups."""
    parser.add_argument(
        "source",
        metavar="SOURCE",
        type=Path,
        help="recording folder, bag or other recording",
    )
    parser.add_argument(
        "-o",
        dest="name",
        type=result_name,
        required=True,
        metavar="NAME",
        help="path of the result files, without suffix",
    )
    parser.add_argument("--json", action="store_true", help="print a summary as JSON")
    parser.add_argument(
        "--force", action="store_true", help="replace the files of an earlier result of that NAME"
    )
    add_options(parser)


def add_options(parser: argparse.ArgumentParser) -> None:
    """Declare all options in groups, except those of the result's path and of the output."""
    _person(parser.add_argument_group("the person (all optional)"))
    _images(parser.add_argument_group("images"))
    _search(parser.add_argument_group("search"))
    _afterwards(parser.add_argument_group("afterwards"))
    _files(parser.add_argument_group("further files"))


def _person(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        "--start",
        type=Path,
        metavar="TRC|YAML",
        help="start pose: first row of a marker file, or named parameters (default: search)",
    )
    group.add_argument(
        "--stature",
        type=float,
        metavar="M",
        help="body height in metres; scales the generic body; "
        "without it and other sizes that of an adult is estimated",
    )
    group.add_argument(
        "--subject",
        type=Path,
        metavar="FILE",
        help="sizes of the person, such as NAME.subject.yaml of an earlier run",
    )
    group.add_argument(
        "--subject-from",
        type=Path,
        metavar="TRC",
        help="measure segment lengths on the first row of a marker file",
    )


def _images(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        "--fps",
        type=float,
        metavar="N",
        help="track every k-th frame, from that of a given start pose on, to get this rate "
        "(default: all)",
    )
    group.add_argument(
        "--scale",
        type=float,
        default=1.0,
        metavar="S",
        help="scale factor of the images, at most 1 (default 1)",
    )
    group.add_argument(
        "--time-offsets",
        metavar="CAM=S,...|FILE",
        help="seconds by which cameras began late, such as cam02=0.05,cam03=-0.1, or a YAML file",
    )
    group.add_argument(
        "--masks",
        type=Path,
        metavar="DIR",
        help="silhouettes made elsewhere, DIR/CAMERA/FRAME.png (such as cam01/000050.png), instead "
        "of background subtraction",
    )
    group.add_argument(
        "--background",
        type=Path,
        metavar="DIR",
        help="empty-scene images or learned backgrounds (.npz), one per camera",
    )
    add_world(group)
    add_format(group)


def add_format(group: "argparse._ActionsContainer") -> None:
    """Declare the options for reading a recording."""
    group.add_argument(
        "--format",
        choices=FORMATS,
        metavar="FORMAT",
        help=f"format of the recording: {', '.join(FORMATS)} (default: detected)",
    )
    group.add_argument("--input-fps", type=float, metavar="N", help="rate of numbered images, 1/s")


def reading_options(args: argparse.Namespace) -> dict[str, Any]:
    """The options of `add_format` and `add_world` as those of `open_recording`."""
    return {name: getattr(args, name) for name in ("format", "input_fps", "up", "units")}


def add_world(group: "argparse._ActionsContainer") -> None:
    """Declare the options that rotate the world of a calibration upright."""
    group.add_argument(
        "--up",
        choices=(*AXES, PERSON),
        default="z",
        metavar="AXIS",
        help="axis of the calibration's world that is up: x, y, z, or -x, -y, -z as --up=-y "
        "(default z); person: up as level cameras have it, the floor under the person",
    )
    group.add_argument(
        "--units",
        choices=tuple(UNITS),
        default="m",
        help="of the lengths in the calibration (default m)",
    )


def _search(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        "--preset",
        choices=tuple(PRESETS),
        help="tuned (default: measures best) or paper (every setting as published)",
    )
    group.add_argument(
        "--optimizer",
        metavar="NAME",
        help=f"search algorithm: {', '.join(OPTIMIZERS)} (default sppso)",
    )
    group.add_argument(
        "--body",
        metavar="NAME|FILE",
        help="body model: person31, balan31, ... or a YAML file (default: person32)",
    )
    group.add_argument(
        "--evaluations",
        type=int,
        metavar="N",
        help="fitness evaluations per frame; with preset tuned, a time budget in these "
        "(default: depends on the optimizer)",
    )
    group.add_argument(
        "--passes",
        type=int,
        choices=(1, 2),
        default=1,
        help="2: go through the recording twice; the first pass fits the body to frames in poses "
        "as different as possible, where no subject is given (default 1)",
    )
    group.add_argument("--seed", type=int, metavar="N", help="seed of all random draws (default 0)")
    group.add_argument(
        "--threads", type=int, metavar="N", help="number of threads; 0 (default): one per core"
    )
    group.add_argument(
        "--config",
        type=Path,
        metavar="FILE",
        help="settings as YAML; the options above take precedence",
    )


def _afterwards(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        "--smooth",
        type=float,
        nargs="?",
        const=CUTOFF_HZ,
        metavar="HZ",
        help="smooth the finished result without lag, with this cutoff frequency, from "
        f"{LEAST_CUTOFF_HZ:g} to half the frame rate (default {CUTOFF_HZ:g}); NAME.json has "
        "velocities then",
    )
    group.add_argument(
        "--fill-gaps",
        type=float,
        metavar="S",
        help="interpolate gaps of at most S seconds (up to 10) between tracked frames; the frames "
        "are marked `filled` in NAME.json",
    )


def _files(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        "--keep-lost",
        action="store_true",
        help="keep the estimates of frames in the states LOST and SEARCHING in NAME.trc (default: "
        "their rows are blank)",
    )
    group.add_argument(
        "--debug-images",
        type=Path,
        metavar="DIR",
        help="write an image per frame and camera: input, background, foreground and shadow, "
        "silhouette, edges, body",
    )
    group.add_argument(
        "--refine-calibration",
        type=Path,
        metavar="OUT.toml",
        help="write the calibration with pose and focal length of disagreeing cameras corrected by "
        "the contours of the whole run; refused if the person hardly moves",
    )


def result_name(text: str) -> Path:
    """The NAME of NAME.trc and NAME.json, type of an argument (`results.target.result_name`).

    Raises:
        argparse.ArgumentTypeError: it names a folder, or nothing.
    """
    try:
        return name_of(text)
    except DatasetError as error:
        raise argparse.ArgumentTypeError(str(error)) from error
