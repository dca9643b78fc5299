"""Recordings on the command line, with values that differ from one to the other."""

import argparse
import json
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TypeVar

from markerless_tracker.benchmarks.machine import machine
from markerless_tracker.cli.benchmark.arguments import list_of, positive, progress_bars
from markerless_tracker.errors import ConfigError
from markerless_tracker.results.result import versions

T = TypeVar("T")
Row = dict[str, Any]
Report = Callable[[str, int, int | None], None]
Measure = Callable[[Path, float | None, float, Report], Row]
"""Figures of a recording, from its stature (m, None = not told), scale and who is told of them."""


def add_recordings(parser: argparse.ArgumentParser, *, without: str = "unknown") -> None:
    """Declare the recordings, the persons' statures, the images' scales, and what all runs share.

    Args:
        parser: takes the arguments.
        without: what holds without a stature, for the help.
    """
    parser.add_argument("sources", nargs="+", type=Path, metavar="SOURCE", help="recording")
    parser.add_argument(
        "--stature", type=list_of_each(positive), default=(), metavar="LIST",
        help=f"of the persons, m: one for all recordings or one each; default: {without}",
    )  # fmt: skip
    parser.add_argument(
        "--scale", type=list_of_each(positive), default=(1.0,), metavar="LIST",
        help="factor for the images, one for all recordings or one each",
    )  # fmt: skip
    parser.add_argument("--threads", type=int, metavar="N", help="0 (default) = one per core")
    parser.add_argument("--config", type=Path, metavar="FILE", help="settings (YAML)")
    parser.add_argument("--json", action="store_true", help="print the figures as JSON")


def measure_each(args: argparse.Namespace, measure: Measure) -> list[Row]:
    """Measure one recording after the other, with a progress bar.

    Raises:
        ConfigError: neither one value nor one per recording.
    """
    statures = each(args.stature or (None,), args.sources, "--stature")
    scales = each(args.scale, args.sources, "--scale")
    with progress_bars() as bars:
        task = bars.add_task("reading", total=None)

        def report(part: str, done: int, total: int | None) -> None:
            bars.update(task, description=part, completed=done, total=total)

        return [
            measure(source, stature_m, scale, report)
            for source, stature_m, scale in zip(args.sources, statures, scales, strict=True)
        ]


def print_json(rows: list[Row]) -> None:
    """The figures for machines, on standard output."""
    table = {"machine": machine(), "versions": versions(), "rows": rows}
    json.dump(table, sys.stdout, indent=2, allow_nan=False)
    sys.stdout.write("\n")


def list_of_each(kind: Callable[[str], T]) -> Callable[[str], tuple[T, ...]]:
    """Parser of a list with commas that keeps values standing twice."""

    def parse(text: str) -> tuple[T, ...]:
        return tuple(list_of(kind)(word)[0] for word in text.split(","))

    return parse


def each(values: tuple[T, ...], sources: Sequence[Path], option: str) -> tuple[T, ...]:
    """A value per source, from one for all or one each.

    Raises:
        ConfigError: neither.
    """
    if len(values) == 1:
        return values * len(sources)
    if len(values) != len(sources):
        raise ConfigError(
            f"{option}: {len(values)} values for {len(sources)} recordings, expected one or "
            f"{len(sources)}"
        )
    return values
