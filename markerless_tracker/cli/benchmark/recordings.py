"""Arguments and output common to the benchmarks that run on recordings one by one."""

import argparse
import json
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TypeVar

from rich.console import Console

from markerless_tracker.benchmarks.machine import machine
from markerless_tracker.benchmarks.with_truth import Report
from markerless_tracker.cli.terminal.arguments import list_of, positive
from markerless_tracker.cli.terminal.bars import progress_bars
from markerless_tracker.cli.track import read_config
from markerless_tracker.errors import ConfigError
from markerless_tracker.results.result import versions
from markerless_tracker.tracking import TrackerConfig

T = TypeVar("T")
Row = dict[str, Any]
Measure = Callable[[Path, float | None, float, Report], Row]
"""Returns the figures of a recording. Arguments: source, stature in m (None = unknown), scale of
the images, receiver of the progress."""


def add_recordings(
    parser: argparse.ArgumentParser, *, without: str = "unknown", sources: str = "+"
) -> None:
    """Declare the recordings, the statures, the scales of the images, and the common options.

    Args:
        parser: receives the arguments.
        without: text of the help on the stature without `--stature`.
        sources: number of recordings, as `nargs` of argparse.
    """
    parser.add_argument("sources", nargs=sources, type=Path, metavar="SOURCE", help="recording")
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


def settings(args: argparse.Namespace, *names: str) -> TrackerConfig:
    """Settings of `--config`, overridden by `--threads` and the named options if given.

    Raises:
        ConfigError: a setting is unknown or has an impossible value.
    """
    given = {name: getattr(args, name) for name in ("threads", *names)}
    return read_config(args.config, {k: v for k, v in given.items() if v is not None})


def run_each(
    args: argparse.Namespace,
    measure: Measure,
    show: Callable[[Console, list[Row]], None],
    *,
    width: int,
) -> int:
    """Measure the recordings one after the other, with a progress bar, and print the figures.

    Args:
        args: parsed arguments, see `add_recordings`.
        measure: measures one recording.
        show: prints the figures for people; not called with `--json`.
        width: columns of the output if standard output is no terminal.

    Returns:
        The exit status.

    Raises:
        ConfigError: `--stature` or `--scale` has neither one value nor one per recording.
    """
    statures = each(args.stature or (None,), args.sources, "--stature")
    scales = each(args.scale, args.sources, "--scale")
    with progress_bars() as bars:
        task = bars.add_task("reading", total=None)

        def report(part: str, done: int, total: int | None) -> None:
            bars.update(task, description=part, completed=done, total=total)

        rows = [
            measure(source, stature_m, scale, report)
            for source, stature_m, scale in zip(args.sources, statures, scales, strict=True)
        ]
    if args.json:
        table = {"machine": machine(), "versions": versions(), "rows": rows}
        json.dump(table, sys.stdout, indent=2, allow_nan=False)
        sys.stdout.write("\n")
    else:
        show(Console(width=None if sys.stdout.isatty() else width), rows)
    return 0


def list_of_each(kind: Callable[[str], T]) -> Callable[[str], tuple[T, ...]]:
    """Parser of a comma-separated list that keeps repeated values."""

    def parse(text: str) -> tuple[T, ...]:
        return tuple(list_of(kind)(word)[0] for word in text.split(","))

    return parse


def each(values: tuple[T, ...], sources: Sequence[Path], option: str) -> tuple[T, ...]:
    """One value per source, from one value for all or one each.

    Raises:
        ConfigError: there is another number of values; names the option.
    """
    if len(values) == 1:
        return values * len(sources)
    if len(values) != len(sources):
        raise ConfigError(
            f"{option}: {len(values)} values for {len(sources)} recordings, expected one or "
            f"{len(sources)}"
        )
    return values
