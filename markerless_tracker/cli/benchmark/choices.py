"""`benchmark tables`: configurations from the options' values or from the papers' tables."""

import argparse
import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from markerless_tracker.benchmarks.tables.papers import PaperRow, PaperTable
from markerless_tracker.cli.track import read_config
from markerless_tracker.errors import ConfigError
from markerless_tracker.tracking import PRESETS, TrackerConfig

_NAMED = ("preset", "optimizer", "body", "refinement", "evaluations")
"""Settings with an option of their own."""
_NOT_VARIED = {
    "seed": "every row has the seeds of --seeds",
    "threads": "every run has one thread",
}


@dataclass(frozen=True)
class Group:
    """Rows of one printed table.

    Attributes:
        table: the paper's table that is reproduced; None = combinations of the options' values.
        rows: the paper's row, if any, and the configuration.
    """

    table: PaperTable | None
    rows: tuple[tuple[PaperRow | None, TrackerConfig], ...]

    @property
    def configs(self) -> tuple[TrackerConfig, ...]:
        """The configurations, in order."""
        return tuple(config for _, config in self.rows)


def varied(text: str) -> tuple[str, tuple[Any, ...]]:
    """Parser of KEY=V,V..., with values as in YAML."""
    key, equals, values = text.partition("=")
    words = [word.strip() for word in values.split(",")]
    if not (key.strip() and equals and all(words)):
        raise argparse.ArgumentTypeError(f"{text!r}, expected KEY=VALUE,VALUE...")
    try:
        return key.strip(), tuple(yaml.safe_load(word) for word in words)
    except (yaml.YAMLError, RecursionError) as error:
        raise argparse.ArgumentTypeError(f"{text!r}: a value cannot be read") from error


def groups(args: argparse.Namespace, papers: Sequence[PaperTable]) -> tuple[Group, ...]:
    """The requested papers' tables, otherwise one group with all combinations of the options.

    Options replace a table's own settings.

    Raises:
        ConfigError: an unknown setting or an impossible value, a setting that is given twice, or
            one that the table itself sets.
    """
    vary: dict[str, tuple[Any, ...]] = {}
    for key, values in args.vary:
        if key in vary:
            raise ConfigError(f"--vary: {key} is given twice")
        vary[key] = values
    for key, reason in _NOT_VARIED.items():
        if key in vary:
            raise ConfigError(f"--vary: {key} is given, but {reason}")
    named = {key: values for key in _NAMED if (values := getattr(args, key))}
    for key in vary:
        if key in named:
            raise ConfigError(f"--vary: {key} is given by --{key}, too, expected one of them")
    choices: dict[str, Sequence[Any]] = {**named, **vary}
    if not papers:
        if args.config is None:
            choices = {"preset": tuple(PRESETS), **choices}
        return (Group(None, tuple((None, c) for c in _configs(args.config, {}, choices))),)
    if "optimizer" in choices:
        raise ConfigError("--table sets the optimizers, it does not go with --optimizer")
    if args.config is None:
        choices = {"preset": ("paper",), **choices}
    return tuple(
        Group(
            table,
            tuple(
                (row, config)
                for row in table.rows
                for config in _configs(args.config, row.settings, choices)
            ),
        )
        for table in papers
    )


def every_config(found: Iterable[Group]) -> tuple[TrackerConfig, ...]:
    """The configurations of all groups, each once."""
    return tuple(dict.fromkeys(config for group in found for config in group.configs))


def _configs(
    file: Path | None, base: Mapping[str, Any], choices: Mapping[str, Sequence[Any]]
) -> list[TrackerConfig]:
    base = TrackerConfig.dotted(base)
    found = [
        read_config(file, {**base, **dict(zip(choices, values, strict=True))})
        for values in itertools.product(*choices.values())
    ]
    return list(dict.fromkeys(found))
