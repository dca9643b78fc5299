"""Verb `calibrate`: calibrates the cameras of a recording of a board."""

import argparse
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from markerless_tracker.calibration.calibrate import Calibration, calibrate
from markerless_tracker.calibration.intrinsics import LEAST_VIEWS
from markerless_tracker.calibration.pictures import coverage_picture, layout_picture
from markerless_tracker.calibration.views import MOST_SETS
from markerless_tracker.camera import write_calibration
from markerless_tracker.camera.board import (
    BOARD_FILE,
    CHARUCO,
    CHECKERBOARD,
    DICTIONARY,
    MARKER_SHARE,
    Board,
    board_squares,
    read_board,
)
from markerless_tracker.cli.terminal.bars import warn
from markerless_tracker.cli.terminal.notices import Bars
from markerless_tracker.datasets.uncalibrated import open_uncalibrated
from markerless_tracker.datasets.writer import write_image
from markerless_tracker.errors import ConfigError, DatasetError
from markerless_tracker.results.appended import make_folder_of

HELP = (
    "Calibrate cameras with a board: intrinsics, lenses and poses of all cameras from one "
    "recording in which a checkerboard or ChArUco board first lies on the floor, print up, and is "
    "then shown to every camera. BOARD_RECORDING is a folder with a video (cam01.mp4, ...) or a "
    "folder of numbered images (cam01/, ...) per camera, or a bag. World: the board on the floor; "
    "origin at the inner corner at the bottom left of its print, x along its columns, z up."
)
EXAMPLE = "markerless_tracker calibrate board -o calibration.toml --square-size 0.12"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    parser.add_argument("recording", metavar="BOARD_RECORDING", type=Path, help="folder or bag")
    parser.add_argument(
        "-o", "--out", metavar="OUT.toml", type=Path, required=True, help="calibration to write"
    )
    board = parser.add_argument_group(
        "board", f"default: those of {BOARD_FILE} in the recording's folder, if there is one"
    )
    board.add_argument(
        "--board", choices=(CHECKERBOARD, CHARUCO), help=f"type of board (default {CHECKERBOARD})"
    )
    board.add_argument(
        "--squares", metavar="CxR",
        help="squares across and down, all of them (default 10x7: 9x6 inner corners)",
    )  # fmt: skip
    board.add_argument(
        "--square-size", type=float, metavar="M", help="side of a square in m; measure the print"
    )
    board.add_argument(
        "--marker-size", type=float, metavar="M",
        help=f"side of a ChArUco marker in m (default {MARKER_SHARE:g} of a square)",
    )  # fmt: skip
    board.add_argument(
        "--dictionary", metavar="NAME", help=f"ChArUco markers (default {DICTIONARY})"
    )
    board.add_argument(
        "--thickness", type=float, default=0.0, metavar="M",
        help="height of the print above the floor while the board lies there (default 0)",
    )  # fmt: skip
    parser.add_argument(
        "--floor-frame", type=int, metavar="N",
        help="frame from which on the board lies on the floor (default: the first in which it is "
        "seen); the frames after it are used as well while the board is still",
    )  # fmt: skip
    parser.add_argument(
        "--sets", type=int, default=MOST_SETS, metavar="N",
        help=f"number of frames searched, evenly spread (default {MOST_SETS})",
    )  # fmt: skip
    parser.add_argument(
        "--k3", action="store_true", help="lens with a third radial coefficient (very wide lenses)"
    )
    parser.add_argument(
        "--pictures", type=Path, metavar="DIR",
        help="folder for a picture of each camera's coverage and of the cameras from above "
        "(default: OUT_pictures)",
    )  # fmt: skip
    parser.add_argument("--force", action="store_true", help="replace an earlier OUT.toml")
    parser.add_argument("--json", action="store_true", help="print the measures as JSON")


def run(args: argparse.Namespace) -> int:
    """Calibrate; returns the exit status."""
    console = Console(stderr=True)
    if args.out.exists() and not args.force:
        raise DatasetError(f"{args.out}: exists already, expected a new name or --force")
    if args.sets < LEAST_VIEWS:
        raise ConfigError(f"--sets is {args.sets}, expected {LEAST_VIEWS} or more")
    if not 0.0 <= args.thickness <= 1.0:
        raise ConfigError(f"--thickness is {args.thickness:g} m, expected 0 to 1")
    make_folder_of(args.out)
    recording = open_uncalibrated(args.recording)
    board = board_of(args, recording.path)
    with Bars(console) as bars:
        bars.begin(f"searching {recording.name}")
        found = calibrate(
            recording,
            board,
            most_sets=args.sets,
            floor_frame=args.floor_frame,
            thickness_m=args.thickness,
            k3=args.k3,
            progress=bars.step,
            adjusting=lambda: bars.begin(f"calibrating {len(recording.rig)} cameras"),
        )
    write_calibration(args.out, found.rig)
    pictures = args.pictures or args.out.with_name(f"{args.out.stem}_pictures")
    _draw(found, board, pictures)
    for text in (*recording.warnings, *found.doubts):
        warn(console, text)
    if args.json:
        summary = {
            "calibration": str(args.out), "pictures": str(pictures), "board": board.describe(),
            **found.as_mapping(), "warnings": list(recording.warnings),
        }  # fmt: skip
        json.dump(summary, sys.stdout, indent=2)
        sys.stdout.write("\n")
        return 0
    out = Console()
    for table in _tables(found):
        out.print(table)
    floor = found.views
    print(
        f"{args.out}: {len(found.rig)} cameras, {len(floor.sets)} poses of the board, error "
        f"{found.error_px:.3f} px; the world is the board in frame {floor.indices[0]}, seen there "
        f"by {', '.join(floor.sets[0])}; pictures in {pictures}"
    )
    return 0


def board_of(args: argparse.Namespace, folder: Path) -> Board:
    """The board of the arguments, with missing values from the recording's `board.yaml`.

    Raises:
        ConfigError: a value is impossible, or the size of the squares is unknown.
    """
    file = folder / BOARD_FILE
    stated: dict[str, Any] = read_board(file) if file.is_file() else {}
    kind = args.board or stated.get("type", CHECKERBOARD)
    squares: Any = board_squares(args.squares) if args.squares else stated.get("squares", (10, 7))
    square_m = args.square_size if args.square_size is not None else stated.get("square_size")
    if square_m is None:
        raise ConfigError(
            "the side of the board's squares is unknown, expected --square-size M (metres)"
        )
    try:
        columns, rows = (int(value) for value in squares)
        square_m = float(square_m)
        if kind != CHARUCO:
            if args.marker_size is not None or args.dictionary is not None:
                raise ConfigError(
                    "--marker-size and --dictionary need a ChArUco board (--board charuco)"
                )
            return Board(kind, columns, rows, square_m)
        marker_m = args.marker_size
        if marker_m is None:
            marker_m = stated.get("marker_size", MARKER_SHARE * square_m)
        names = args.dictionary or stated.get("dictionary", DICTIONARY)
        return Board(kind, columns, rows, square_m, float(marker_m), str(names))
    except (TypeError, ValueError) as error:
        raise ConfigError(f"{file}: {error}, expected squares: [10, 7], square_size: M") from error


def _draw(found: Calibration, board: Board, folder: Path) -> None:
    for name, measures in found.cameras.items():
        write_image(folder / f"{name}.png", coverage_picture(found.bundle, name, measures))
    layout = layout_picture(found.rig, found.bundle.boards, board.outline_m)
    write_image(folder / "layout.png", layout)


def _tables(found: Calibration) -> list[Table]:
    cameras = Table(title="cameras: error, share of the image that is covered, place")
    heads = ("camera", "views", "px", "cover", "focal px", "field", "x, y, z m", "± mm")
    for head in heads:
        cameras.add_column(head, justify="left" if head == "camera" else "right", no_wrap=True)
    for camera in found.rig:
        of = found.cameras[camera.name]
        focal = float(camera.matrix[0, 0])
        field = np.degrees(2.0 * np.arctan(0.5 * camera.size_px[0] / focal))
        cameras.add_row(
            camera.name, str(of.views), f"{of.error_px:.2f}", f"{of.coverage:.0%}",
            f"{focal:.0f}±{focal * of.focal_sd:.1f}", f"{field:.0f}°",
            " ".join(f"{x:.2f}" for x in camera.T_world_cam[:3, 3]), f"{of.position_sd_mm:.0f}",
        )  # fmt: skip
    pairs = Table(title="pairs")
    for head in ("cameras", "common views", "error px"):
        pairs.add_column(head, justify="left" if head == "cameras" else "right")
    for (a, b), pair in found.pairs.items():
        pairs.add_row(f"{a} {b}", str(pair.views), f"{pair.error_px:.3f}")
    return [cameras, pairs]
