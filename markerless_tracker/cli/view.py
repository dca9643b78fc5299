"""Verb `view`: pictures of a result, and the Rerun viewer."""

import argparse
import json
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

import cv2
from rich.console import Console

from markerless_tracker.cli.terminal.arguments import count, positive
from markerless_tracker.cli.terminal.bars import progress_bars, warn
from markerless_tracker.cli.track_arguments import result_name
from markerless_tracker.cli.view_node import has_display, run_node
from markerless_tracker.errors import ConfigError, DatasetError
from markerless_tracker.results.export.new_file import new_file
from markerless_tracker.results.read import read_result
from markerless_tracker.results.stored_result import StoredResult, result_names, set_back
from markerless_tracker.viewing.film import FORMATS, require_av, write_film
from markerless_tracker.viewing.images import ResultImages
from markerless_tracker.viewing.overlays import Overlays, chosen_rows, spread_rows
from markerless_tracker.viewing.rerun_file import require_rerun, write_rrd

HELP = (
    "Show a result: the body over the images (left limbs cyan, right limbs yellow, ellipses of two "
    "standard deviations), as a film, as a picture of some frames, or in the Rerun viewer, which "
    "has the body in 3D with cameras and floor, and angles, deviations and overlap over time. The "
    "images are those of the result's source, or of --source. Without an output the Rerun viewer "
    "opens. Films and the viewer need markerless_tracker[view]. With --node the same of a running "
    "tracker, from its topics."
)
EXAMPLE = "markerless_tracker view out/walk --film walk.webm --sheet walk.png"

_FRAMES = 4
"""Frames of a picture, if none are given."""
_LEAST_WIDTH_PX = 64
MOST_RRD_PICTURES = 300
"""Largest number of frames with pictures in the file for the Rerun viewer."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    parser.add_argument(
        "name", metavar="NAME", nargs="?", type=result_name, help="NAME of NAME.trc and NAME.json"
    )
    parser.add_argument(
        "--node",
        action="store_true",
        help="show the running tracker instead of a result: in the Rerun viewer, or with --rrd "
        "and --sheet (the last pictures)",
    )
    parser.add_argument(
        "--seconds", metavar="S", type=positive, help="with --node: end after S seconds"
    )
    parser.add_argument(
        "--source",
        metavar="DIR",
        type=Path,
        help="recording with the images (default: the one that the result names)",
    )
    parser.add_argument(
        "--film", metavar="FILE", type=_file(FORMATS), help="film, .webm (VP9) or .mp4 (H.264)"
    )
    parser.add_argument(
        "--sheet",
        metavar="FILE.png",
        type=_file(("png", "jpg")),
        help="picture of some frames, a line for each",
    )
    parser.add_argument(
        "--rrd",
        metavar="FILE.rrd",
        type=_file(("rrd",)),
        help="file for the Rerun viewer: rerun FILE.rrd",
    )
    parser.add_argument(
        "--frames",
        metavar="N",
        type=count,
        help=f"frames of the picture, from the first to the last (default {_FRAMES})",
    )
    parser.add_argument(
        "--width",
        metavar="PX",
        type=_width,
        default=1280,
        help="width of film and picture (default 1280)",
    )
    parser.add_argument(
        "--whole",
        action="store_true",
        help="show whole images in film and picture, not only the part in which the person moves",
    )
    parser.add_argument("--force", action="store_true", help="replace existing files")
    parser.add_argument("--json", action="store_true", help="print the written files as JSON")


def run(args: argparse.Namespace) -> int:
    """Show the result, or the running tracker; returns the exit status."""
    targets = [path for path in (args.film, args.sheet, args.rrd) if path is not None]
    for path in targets:
        if path.exists() and not args.force:
            raise DatasetError(f"{path}: exists already, expected a new name or --force")
    if args.node:
        return run_node(args)
    if args.name is None:
        raise ConfigError("expected NAME of a result, or --node")
    if args.seconds is not None:
        raise ConfigError("--seconds is given without --node, expected both")
    if args.film is not None:
        require_av()
    if args.rrd is not None or not targets:
        require_rerun()
    if not targets and not has_display():
        raise ConfigError(
            "there is no display for the Rerun viewer, expected --film, --sheet or --rrd"
        )
    name = args.name
    result = read_result(name)
    if more := result_names(name)[1:]:
        warn(Console(stderr=True), set_back(name, more))
    images = ResultImages(result, args.source, width_px=args.width // 2, whole=args.whole)
    for path in targets:
        path.parent.mkdir(parents=True, exist_ok=True)
    if not targets:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / f"{name.name}.rrd"
            _write(result, images, rrd=path)
            return subprocess.run([sys.executable, "-m", "rerun", str(path)]).returncode
    _write(
        result, images, film=args.film, sheet=args.sheet, rrd=args.rrd,
        frames=_FRAMES if args.frames is None else args.frames, width_px=args.width,
    )  # fmt: skip
    if args.json:
        json.dump({"files": [str(path) for path in targets]}, sys.stdout, indent=2)
        sys.stdout.write("\n")
    else:
        for path in targets:
            print(path)
    return 0


def _write(
    result: StoredResult,
    images: ResultImages,
    *,
    film: Path | None = None,
    sheet: Path | None = None,
    rrd: Path | None = None,
    frames: int = 0,
    width_px: int = 0,
) -> None:
    """Write the files whose paths are given."""
    with progress_bars() as bars:
        task = bars.add_task("reading", total=None)

        def begin(path: Path) -> None:
            bars.reset(task, description=f"drawing {path.name}")

        overlays = Overlays(
            result,
            images,
            progress=lambda done, total: bars.update(task, completed=done, total=total),
        )
        if film is not None:
            begin(film)
            rows = list(range(len(result)))
            shown = (
                (float(result.times_s[row]), picture)
                for row, picture in overlays.sheets(rows, width_px=width_px)
            )
            write_film(film, shown, fps=result.fps, container=film.suffix[1:].lower())
        if sheet is not None:
            begin(sheet)
            picture = overlays.contact_sheet(spread_rows(len(result), frames), width_px=width_px)
            with new_file(sheet, binary=True) as sink:
                sink.write(cv2.imencode(sheet.suffix, picture)[1].tobytes())
        if rrd is not None:
            begin(rrd)
            rows = chosen_rows(len(result), MOST_RRD_PICTURES)
            write_rrd(rrd, result, rig=images.rig, overlays=overlays, rows=rows)


def _width(text: str) -> int:
    width_px = count(text)
    if width_px < _LEAST_WIDTH_PX:
        raise argparse.ArgumentTypeError(f"{text!r}, expected at least {_LEAST_WIDTH_PX} px")
    return width_px


def _file(endings: Sequence[str]) -> Callable[[str], Path]:
    """Parser of an argument: a file with one of the given endings."""

    def parse(text: str) -> Path:
        path = Path(text)
        if path.suffix[1:].lower() not in endings:
            raise argparse.ArgumentTypeError(
                f"{text!r}, expected a file that ends in .{' or .'.join(endings)}"
            )
        return path

    return parse
