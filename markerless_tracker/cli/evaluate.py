"""Verb `evaluate`: errors of results with respect to reference markers."""

import argparse
import json
import math
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from markerless_tracker.body import MARKER_NAMES
from markerless_tracker.datasets import MarkerTrack
from markerless_tracker.datasets.markers.c3d import read_markers
from markerless_tracker.datasets.markers.sets import MARKER_SETS, Sources, read_marker_map, renamed
from markerless_tracker.errors import DatasetError
from markerless_tracker.geometry import FloatArray
from markerless_tracker.results.comparison.alignment import Alignment, align
from markerless_tracker.results.comparison.measures import Measures, measures
from markerless_tracker.results.score import Score, score
from markerless_tracker.results.stored import stored_frames

HELP = (
    "Compare marker files with a reference: rows are matched by Time, markers by name, errors are "
    "in mm. A missing Pelvis is replaced by the midpoint of the hips; rows that are blank in "
    "either file are not compared, nor frames that the JSON file beside a result calls LOST or "
    "SEARCHING. With `offsets off` each joint's mean offset in the heading frame is subtracted "
    "from its errors. `inside sd` is the share of the errors per axis within 1, 2 and 3 of the "
    "standard deviations in the JSON file. MPJPE is the mean error after the pelvis is aligned in "
    "each frame, PA-MPJPE after rotation, translation and scale are, PCK the share of joints "
    "within 150 mm after the pelvis is aligned."
)
EXAMPLE = "markerless_tracker evaluate out/walk.trc walk/ground_truth.trc --skip 30"

_WIDTH = 160
_FAR_MM = 300.0
"""No tracked person is this far from the reference on average."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    parser.add_argument(
        "results",
        metavar="RESULT",
        type=Path,
        nargs="+",
        help="marker files to evaluate (TRC, C3D), or NAME of NAME.trc",
    )
    parser.add_argument(
        "reference",
        metavar="REFERENCE",
        type=Path,
        help="marker file with the reference (TRC, C3D)",
    )
    parser.add_argument(
        "--markers",
        metavar="SET|MAP.yaml",
        help=f"names of the reference's markers: {', '.join(MARKER_SETS)}, or a YAML file with "
        "lines `LWrist: name` or `LWrist: [one, other]` (their mean)",
    )
    parser.add_argument(
        "--align",
        action="store_true",
        help="align the worlds by one rigid transform and the clocks by one offset (both are "
        "reported) before the comparison",
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


@dataclass(frozen=True, eq=False)
class _Figures:
    """All figures of one result."""

    score: Score
    measures: Measures
    alignment: Alignment | None

    def as_dict(self) -> dict[str, Any]:
        aligned = {} if self.alignment is None else {"alignment": self.alignment.as_dict()}
        return {**self.score.as_dict(), **self.measures.as_dict(), **aligned}


def run(args: argparse.Namespace) -> int:
    """Evaluate; returns the exit status."""
    names = None if args.markers is None else read_marker_map(args.markers)
    reference = read_markers(args.reference)
    if names is not None:
        reference = _renamed(args.reference, reference, names)
    args.results = [_marker_file(path) for path in args.results]
    figures = [_figures(path, reference, names, args) for path in args.results]
    if args.json:
        single = figures[0].as_dict() if len(figures) == 1 else None
        several = [
            {"result": str(path), **found.as_dict()}
            for path, found in zip(args.results, figures, strict=True)
        ]
        json.dump(single or several, sys.stdout, indent=2, allow_nan=False)
        sys.stdout.write("\n")
        return 0
    # Without a terminal rich assumes 80 columns, too few for a table of several results.
    console = Console(width=None if sys.stdout.isatty() else _WIDTH)
    if len(figures) > 1:
        console.print(_summary_table(args.results, figures))
    else:
        console.print(_joint_table(figures[0].score))
        for line in _lines(figures[0]):
            _say(console, line)
    for path, found in zip(args.results, figures, strict=True):
        where = f"{path}: " if len(figures) > 1 else ""
        for line in _remarks(found):
            _say(console, where + line)
    return 0


def _marker_file(path: Path) -> Path:
    """NAME.trc of a result that is given as NAME, as for other verbs."""
    file = path.with_name(f"{path.name}.trc") if path.name else path
    return file if file.is_file() and not path.is_file() else path


def _lines(found: _Figures) -> list[str]:
    """The figures of one result, in lines that a terminal of 80 columns does not wrap."""
    figures, more = found.score, found.measures
    return [
        f"mean {figures.mean_mm:.1f} mm, limbs {_text(figures.limbs_mm)} mm; worst frame "
        f"{figures.max_mm:.1f} mm, worst joint {figures.worst_joint_mm:.1f} mm",
        f"offsets off: {_text(figures.offsets_off_mm)} mm, limbs "
        f"{_text(figures.offsets_off_limbs_mm)} mm",
        f"MPJPE {_text(more.mpjpe_mm)} mm, PA-MPJPE {_text(more.pa_mpjpe_mm)} mm, PCK "
        f"{_share(more.pck)}",
        f"inside 1, 2, 3 sd: {_shares(figures)}",
        _compared(found),
    ]


def _compared(found: _Figures) -> str:
    """The numbers of frames; aligned tracks are compared at the result's times."""
    figures = found.score
    if found.alignment is None:
        return f"{figures.frames} of {figures.reference_frames} reference frames compared"
    return (
        f"{figures.frames} frames of the result compared; the reference has "
        f"{figures.reference_frames}"
    )


def _remarks(found: _Figures) -> list[str]:
    """Remarks on what was not compared, and on the alignment of the worlds."""
    more, lines = found.measures, []
    if more.only_reference:
        lines.append(f"not compared: {', '.join(more.only_reference)} of the reference")
    if more.only_result:
        lines.append(f"not compared: {', '.join(more.only_result)} of the result")
    if found.alignment is None and found.score.mean_mm > _FAR_MM:
        lines.append(
            "large errors: is the reference of this recording, and in the same world? (--align)"
        )
    if found.alignment is not None:
        moved = found.alignment
        x, y, z = (1000.0 * value for value in moved.translation_m.tolist())
        lines.append(
            f"aligned: rotation {moved.angle_deg:.2f} degrees, translation {x:.1f} {y:.1f} "
            f"{z:.1f} mm, the reference's clock {1000.0 * moved.offset_s:+.1f} ms, rms distance "
            f"{moved.rms_mm:.1f} mm"
        )
    return lines


def _say(console: Console, text: str) -> None:
    console.print(text, highlight=False, markup=False, soft_wrap=True)


def _renamed(path: Path, track: MarkerTrack, names: Mapping[str, Sources]) -> MarkerTrack:
    try:
        return renamed(track, names)
    except DatasetError as error:
        raise DatasetError(f"{path}: {error}") from error


def _count(text: str) -> int:
    if not (text.isascii() and text.isdecimal()):
        raise argparse.ArgumentTypeError(f"{text!r}, expected a whole number from 0 on")
    return int(text)


def _figures(
    path: Path,
    reference: MarkerTrack,
    names: Mapping[str, Sources] | None,
    args: argparse.Namespace,
) -> _Figures:
    result, deviations = read_markers(path), None
    if names is not None and not set(result.names) & set(MARKER_NAMES):
        # A result of another tool, with the reference's names.
        result = _renamed(path, result, names)
    else:
        result, deviations = _stored(path, result)
    alignment = rows = None
    try:
        if args.align:
            alignment = align(result, reference)
            rows = len(reference)
            if 0 < args.skip < len(result):
                rows = alignment.rows_from(int(result.stamps_ns[args.skip]), reference)
            # This tracker's world has a vertical z axis; that of others may lie on its side.
            ours = deviations is not None
            result, reference = alignment.apply(result, reference, into_result=ours)
        return _Figures(
            score(
                result,
                reference,
                markers_sd_mm=deviations,
                skip=args.skip,
                reference_frames=rows,
            ),
            measures(result, reference, skip=args.skip),
            alignment,
        )
    except DatasetError as error:
        hint = "; --markers names a set of markers" if "no common marker" in str(error) else ""
        raise DatasetError(f"{path}: {error}{hint}") from error


def _stored(path: Path, result: MarkerTrack) -> tuple[MarkerTrack, FloatArray | None]:
    """The result without lost frames and its deviations, if there is a JSON file beside it."""
    try:
        stored = stored_frames(path, result)
    except DatasetError as error:
        # The marker file of another tool may have any JSON file beside it.
        print(f"{path}: evaluated without states and deviations: {error}", file=sys.stderr)
        stored = None
    return (result, None) if stored is None else (stored.track, stored.markers_sd_mm)


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


def _summary_table(paths: list[Path], several: list[_Figures]) -> Table:
    table = Table(title="Errors, mm")
    table.add_column("result", overflow="fold")
    for heading in (
        "mean", "worst frame", "worst joint", "limbs", "offsets off", "limbs, offsets off",
        "MPJPE", "PA-MPJPE", "PCK", "inside 1, 2, 3 sd", "frames",
    ):  # fmt: skip
        table.add_column(heading, justify="right")
    for path, found in zip(paths, several, strict=True):
        figures, more = found.score, found.measures
        millimetres = (
            figures.mean_mm, figures.max_mm, figures.worst_joint_mm, figures.limbs_mm,
            figures.offsets_off_mm, figures.offsets_off_limbs_mm, more.mpjpe_mm, more.pa_mpjpe_mm,
        )  # fmt: skip
        table.add_row(
            escape(str(path)),
            *(_text(value) for value in millimetres),
            _share(more.pck),
            _shares(figures),
            f"{figures.frames} of {figures.reference_frames}",
        )
    return table


def _share(value: float | None) -> str:
    return "-" if value is None else f"{value:.3f}"


def _shares(figures: Score) -> str:
    if figures.inside_sd is None:
        return "-"
    return ", ".join(f"{share:.3f}" for share in figures.inside_sd)


def _text(value: float | None, *, sign: str = "") -> str:
    return "-" if value is None or not math.isfinite(value) else f"{value:{sign}.1f}"
