"""Verb `evaluate`: errors of a result with respect to reference markers."""

import argparse
import json
import math
import sys
from pathlib import Path

from rich.console import Console
from rich.table import Table

from markerless_tracker.datasets import read_trc
from markerless_tracker.results.score import Score, score

HELP = (
    "Compare two marker files: rows are matched by Time, markers by name, errors are in mm. A "
    "missing Pelvis is replaced by the midpoint of the hips; rows that are blank in either file "
    "are not compared."
)
EXAMPLE = "markerless_tracker evaluate out/walk.trc recordings/walk/ground_truth.trc"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    parser.add_argument("result", metavar="RESULT.trc", type=Path, help="marker file to evaluate")
    parser.add_argument(
        "reference", metavar="REFERENCE.trc", type=Path, help="marker file with the reference"
    )
    parser.add_argument("--json", action="store_true", help="print the errors as JSON")


def run(args: argparse.Namespace) -> int:
    """Evaluate; returns the exit status."""
    figures = score(read_trc(args.result), read_trc(args.reference))
    if args.json:
        json.dump(figures.as_dict(), sys.stdout, indent=2, allow_nan=False)
        sys.stdout.write("\n")
        return 0
    console = Console()
    console.print(_table(figures))
    console.print(
        f"mean {figures.mean_mm:.1f} mm, worst frame {figures.max_mm:.1f} mm, worst joint in a "
        f"frame {figures.worst_joint_mm:.1f} mm, limbs {_text(figures.limbs_mm)} mm; "
        f"{figures.frames} of {figures.reference_frames} reference frames compared",
        highlight=False,
        soft_wrap=True,
    )
    return 0


def _table(figures: Score) -> Table:
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


def _text(value: float, *, sign: str = "") -> str:
    return f"{value:{sign}.1f}" if math.isfinite(value) else "-"
