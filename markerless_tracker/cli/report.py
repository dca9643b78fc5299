"""Verb `report`: one HTML page about one result, or about several side by side."""

import argparse
import json
import sys
import time
from pathlib import Path

from rich.console import Console

from markerless_tracker.cli.terminal.bars import progress_bars, warn
from markerless_tracker.cli.track_arguments import result_name
from markerless_tracker.datasets import MarkerTrack
from markerless_tracker.datasets.markers.c3d import read_markers
from markerless_tracker.datasets.markers.sets import MARKER_SETS, read_marker_map, renamed
from markerless_tracker.errors import ConfigError, DatasetError, TrackerError
from markerless_tracker.results.read import read_result
from markerless_tracker.results.stored_result import StoredResult, result_names, set_back
from markerless_tracker.viewing.images import ResultImages
from markerless_tracker.viewing.page.charts import Level
from markerless_tracker.viewing.page.embedded import IMAGE_PX, embedded_film
from markerless_tracker.viewing.page.page import write_page
from markerless_tracker.viewing.page.report import Film, make_report

HELP = (
    "Write one HTML page about a result, or about several side by side: film of the body over the "
    "images, verdict, error over time beside the papers' levels, joints, angles, gait, "
    "silhouettes, settings. The page holds everything and opens without a network. The film needs "
    "PyAV (markerless_tracker[view]) and the images of the result's source, or of --source."
)
EXAMPLE = "markerless_tracker report out/walk -o walk.html --reference walk/truth.trc"

PAPERS = (
    ("sppso_2", {"evaluations": 1000}, "Lee walk", "SPPSO, Lee walk"),
    ("hmcpso_2", {"optimizer": "hmcpso"}, "S2 walk", "H-MCPSO, S2 walk"),
)
"""The papers' errors shown for comparison: table, settings of the row, recording, label."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    parser.add_argument(
        "names", metavar="NAME", type=result_name, nargs="+", help="NAME of NAME.trc and NAME.json"
    )
    parser.add_argument(
        "-o", dest="out", metavar="PAGE.html", type=Path, required=True, help="the page"
    )
    parser.add_argument(
        "--source",
        metavar="DIR",
        type=Path,
        action="append",
        help="recording of the results' images, once for all or once for each (default: the one "
        "that a result names)",
    )
    parser.add_argument(
        "--reference",
        metavar="FILE",
        type=Path,
        action="append",
        help="marker file with the reference (TRC, C3D), once for all or once for each",
    )
    parser.add_argument(
        "--markers",
        metavar="SET|MAP.yaml",
        help=f"names of the reference's markers: {', '.join(MARKER_SETS)}, or a YAML file, as for "
        "`evaluate`",
    )
    parser.add_argument("--no-film", action="store_true", help="leave the film out")
    parser.add_argument("--force", action="store_true", help="replace an existing page")
    parser.add_argument("--json", action="store_true", help="print a summary as JSON")


def run(args: argparse.Namespace) -> int:
    """Write the page; returns the exit status."""
    console = Console(stderr=True)
    if args.out.exists() and not args.force:
        raise DatasetError(f"{args.out}: exists already, expected a new name or --force")
    if args.markers is not None and not args.reference:
        raise ConfigError("--markers is given without --reference, expected both")
    if args.no_film and args.source:
        raise ConfigError("--source is given with --no-film, expected one of them")
    names = args.names
    sources = _for_each(args.source, len(names), "--source")
    references = _for_each(args.reference, len(names), "--reference")
    started = time.perf_counter()
    reports = []
    for name, source, reference in zip(names, sources, references, strict=True):
        result = read_result(name)
        if more := [part for part in result_names(name)[1:] if part not in names]:
            warn(console, set_back(name, more))
        film, why = None, "--no-film"
        if not args.no_film:
            film, why = _film(console, name, result, source, len(names))
        track = None if reference is None else _reference(reference, args.markers)
        reports.append(
            make_report(_title(name, names), result, reference=track, film=film, why_no_film=why)
        )
    levels = _levels() if any(report.score is not None for report in reports) else []
    write_page(args.out, reports, levels=levels)
    seconds, size = time.perf_counter() - started, args.out.stat().st_size
    if args.json:
        summary = {
            "page": str(args.out),
            "bytes": size,
            "seconds": round(seconds, 2),
            "results": [
                {
                    "name": str(name),
                    "verdict": report.sentence(),
                    "film_frames": report.film.frames if report.film else 0,
                    "mean_mm": report.score.mean_mm if report.score else None,
                    "gait": {
                        found.name.replace(" ", "_"): found.mean
                        for found in (report.gait.parameters() if report.gait else ())
                        if found.count
                    },
                }
                for name, report in zip(names, reports, strict=True)
            ],
        }
        json.dump(summary, sys.stdout, indent=2)
        sys.stdout.write("\n")
    else:
        print(f"{args.out}: {size / 1e6:.1f} MB in {seconds:.1f} s")
        for name, report in zip(names, reports, strict=True):
            print(f"{name}: {report.sentence()}")
    return 0


def _film(
    console: Console, name: Path, result: StoredResult, source: Path | None, films: int
) -> tuple[Film | None, str]:
    """The film, or the reason why there is none; a given source must exist."""
    try:
        images = ResultImages(result, source, width_px=IMAGE_PX, whole=False)
        with progress_bars(console) as bars:
            task = bars.add_task(f"film of {name.name}", total=None)
            return embedded_film(
                result,
                images,
                films=films,
                progress=lambda done, most: bars.update(task, completed=done, total=most),
            ), ""
    except TrackerError as error:
        if source is not None:
            raise
        warn(console, f"{name}: no film: {error}")
        return None, str(error)


def _reference(path: Path, markers: str | None) -> MarkerTrack:
    track = read_markers(path)
    if markers is None:
        return track
    try:
        return renamed(track, read_marker_map(markers))
    except DatasetError as error:
        raise DatasetError(f"{path}: {error}") from error


def _levels() -> list[Level]:
    """The papers' mean errors."""
    from markerless_tracker.benchmarks.tables.papers import read_papers

    tables = read_papers()
    found = []
    for name, settings, recording, label in PAPERS:
        for row in tables[name].rows:
            figures = row.theirs.get(recording, {})
            if settings.items() <= row.settings.items() and "mean_mm" in figures:
                found.append(Level(f"{label}: {figures['mean_mm']:g} mm", figures["mean_mm"]))
    return found


def _title(name: Path, names: list[Path]) -> str:
    alone = sum(other.name == name.name for other in names) == 1
    return name.name if alone else str(name)


def _for_each(given: list[Path] | None, count: int, option: str) -> list[Path | None]:
    """A value for each result."""
    if not given:
        return [None] * count
    if len(given) not in (1, count):
        raise DatasetError(f"{option}: got {len(given)}, expected one for all or {count}")
    return [*given] * (count if len(given) == 1 else 1)
