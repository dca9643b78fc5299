"""Verb `evaluate`: errors of results with respect to reference markers."""

import argparse
import json
import math
import sys
from pathlib import Path

from rich.console import Console
from rich.table import Table

from markerless_tracker.datasets import MarkerTrack, read_trc
from markerless_tracker.errors import DatasetError
from markerless_tracker.results.score import Score, score
from markerless_tracker.results.stored import stored_frames

HELP = (
    "Compare marker files with a reference: rows are matched by Time, markers by name, errors are "
    "in mm. A missing Pelvis is replaced by the midpoint of the hips; rows that are blank in "
    "either file are not compared, nor frames that the JSON file beside a result calls LOST. With "
    "`offsets off` each joint's mean offset in the heading frame is subtracted from its errors. "
    "`inside sd` is the share of the errors per axis within 1, 2 and 3 of the standard deviations "
    "in the JSON file."
)
EXAMPLE = "markerless_tracker evaluate out/walk.trc recordings/walk/ground_truth.trc --skip 30"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    parser.add_argument(
        "results", metavar="RESULT.trc", type=Path, nargs="+", help="marker files to evaluate"
    )
    parser.add_argument(
        "reference", metavar="REFERENCE.trc", type=Path, help="marker file with the reference"
    )
    parser.add_argument(
        "--skip",
        metavar="N",
        type=_count,
        default=0,
        help="leave out the first N frames of each result, blank ones included (default: 0)",
    )
    parser.add_argument(
        "--json", action="store_true", help="print the errors as JSON, of several results as a list"
    )


def run(args: argparse.Namespace) -> int:
    """Evaluate; returns the exit status."""
    reference = read_trc(args.reference)
    scores = [_score(path, reference, args.skip) for path in args.results]
    if args.json:
        single = scores[0].as_dict() if len(scores) == 1 else None
        several = [
            {"result": str(path), **figures.as_dict()}
            for path, figures in zip(args.results, scores, strict=True)
        ]
        json.dump(single or several, sys.stdout, indent=2, allow_nan=False)
        sys.stdout.write("\n")
        return 0
    console = Console()
    if len(scores) > 1:
        console.print(_summary_table(args.results, scores))
        return 0
    figures = scores[0]
    console.print(_joint_table(figures))
    console.print(
        f"mean {figures.mean_mm:.1f} mm, worst frame {figures.max_mm:.1f} mm, worst joint in a "
        f"frame {figures.worst_joint_mm:.1f} mm, limbs {_text(figures.limbs_mm)} mm; "
        f"offsets off {_text(figures.offsets_off_mm)} mm, limbs "
        f"{_text(figures.offsets_off_limbs_mm)} mm; inside 1, 2, 3 sd {_shares(figures)}; "
        f"{figures.frames} of {figures.reference_frames} reference frames compared",
        highlight=False,
        soft_wrap=True,
    )
    return 0


def _count(text: str) -> int:
    if not (text.isascii() and text.isdecimal()):
        raise argparse.ArgumentTypeError(f"{text!r}, expected a whole number from 0 on")
    return int(text)


def _score(path: Path, reference: MarkerTrack, skip: int) -> Score:
    result = read_trc(path)
    deviations = None
    try:
        stored = stored_frames(path, result)
    except DatasetError as error:
        # The marker file of another tool may have any JSON file beside it.
        print(f"{path}: evaluated without states and deviations: {error}", file=sys.stderr)
        stored = None
    if stored is not None:
        result, deviations = stored.track, stored.markers_sd_mm
    try:
        return score(result, reference, markers_sd_mm=deviations, skip=skip)
    except DatasetError as error:
        raise DatasetError(f"{path}: {error}") from error


def _joint_table(figures: Score) -> Table:
    table = Table(title="Error per joint, mm")
    table.add_column("joint")
    for heading in ("mean", "worst", "last frame", "forward", "left", "up"):
        table.add_column(heading, justify="right")
    for column, (name, mean) in enumerate(figures.joints.items()):
        errors = [value for value in figures.joint_mm[:, column].tolist() if math.isfinite(value)]
        bias = figures.bias.get(name, (math.nan,) * 3)
        table.add_row(
            name,
            _text(mean),
            _text(max(errors, default=math.nan)),
            _text(figures.joint_mm[-1, column]),
            *(_text(value, sign="+") for value in bias),
        )
    return table


def _summary_table(paths: list[Path], scores: list[Score]) -> Table:
    table = Table(title="Errors, mm")
    table.add_column("result", overflow="fold")
    for heading in (
        "mean", "worst frame", "worst joint", "limbs", "offsets off", "limbs, offsets off",
        "inside 1, 2, 3 sd", "frames",
    ):  # fmt: skip
        table.add_column(heading, justify="right")
    for path, figures in zip(paths, scores, strict=True):
        millimetres = (
            figures.mean_mm, figures.max_mm, figures.worst_joint_mm, figures.limbs_mm,
            figures.offsets_off_mm, figures.offsets_off_limbs_mm,
        )  # fmt: skip
        table.add_row(
            str(path),
            *(_text(value) for value in millimetres),
            _shares(figures),
            f"{figures.frames} of {figures.reference_frames}",
        )
    return table


def _shares(figures: Score) -> str:
    if figures.inside_sd is None:
        return "-"
    return ", ".join(f"{share:.3f}" for share in figures.inside_sd)


def _text(value: float, *, sign: str = "") -> str:
    return f"{value:{sign}.1f}" if math.isfinite(value) else "-"
