"""Recordings on the command line, with values that differ from one to the other."""

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TypeVar

from markerless_tracker.cli.benchmark.arguments import list_of, positive
from markerless_tracker.errors import ConfigError

T = TypeVar("T")


def add_recordings(parser: argparse.ArgumentParser, *, without: str = "unknown") -> None:
    """Declare the recordings, the persons' statures and the images' scales.

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
