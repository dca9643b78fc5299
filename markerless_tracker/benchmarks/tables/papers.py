"""The papers' tables: settings of each row, and the figures that the papers print."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from markerless_tracker.errors import ConfigError
from markerless_tracker.resources import config_file

FIGURES = ("mean_mm", "sd_mm", "max_mm", "s_per_frame", "ms_per_evaluation")
"""Figures that a paper may print for a row; keys as in `accuracy.summarise`."""

Figures = Mapping[str, float]


@dataclass(frozen=True)
class PaperRow:
    """A row of a paper's table.

    Attributes:
        settings: settings of the row, added to a preset.
        theirs: printed figures by the paper's recordings.
    """

    settings: Mapping[str, Any]
    theirs: Mapping[str, Figures]


@dataclass(frozen=True)
class PaperTable:
    """A table of a paper.

    Attributes:
        name: short name.
        title: title for display.
        source: paper and data of the figures.
        note: remark from the paper's text; '' = none.
        rates: frames per second for which the figures hold.
        rows: the rows in order.
    """

    name: str
    title: str
    source: str
    note: str
    rates: tuple[float, ...]
    rows: tuple[PaperRow, ...]

    @property
    def recordings(self) -> tuple[str, ...]:
        """The paper's recordings, in the order of the rows."""
        return tuple(dict.fromkeys(name for row in self.rows for name in row.theirs))


def read_papers(path: Path | None = None) -> Mapping[str, PaperTable]:
    """The tables of a file by name; of the shipped `papers.yaml` unless one is given.

    Raises:
        ConfigError: the file cannot be read or has another structure; names file and place.
    """
    path = path or config_file("papers.yaml")
    try:
        data = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, yaml.YAMLError, RecursionError) as error:
        raise ConfigError(f"{path}: cannot be read: {' '.join(str(error).split())}") from error
    try:
        return {name: _table(name, entry, data["papers"]) for name, entry in data["tables"].items()}
    except (KeyError, TypeError, AttributeError, ValueError) as error:
        raise ConfigError(f"{path}: no tables of papers: {type(error).__name__} {error}") from error


def choose(tables: Mapping[str, PaperTable], names: Sequence[str]) -> tuple[PaperTable, ...]:
    """The named tables, each once; 'all' selects every table.

    Raises:
        ConfigError: a name is unknown.
    """
    found: dict[str, PaperTable] = {}
    for name in names:
        if name != "all" and name not in tables:
            raise ConfigError(f"table {name!r} is unknown, expected all or {', '.join(tables)}")
        found.update(tables if name == "all" else {name: tables[name]})
    return tuple(found.values())


def _table(name: str, entry: Mapping[str, Any], papers: Mapping[str, str]) -> PaperTable:
    rows = []
    for number, row in enumerate(entry["rows"]):
        theirs = {where: dict(figures) for where, figures in row.get("theirs", {}).items()}
        for where, figures in theirs.items():
            for key, value in figures.items():
                if key not in FIGURES or not isinstance(value, int | float):
                    raise ValueError(
                        f"{name}: row {number + 1}: {where}: {key}: got {value!r}, expected a "
                        f"number of {', '.join(FIGURES)}"
                    )
        rows.append(PaperRow(dict(row["settings"]), theirs))
    return PaperTable(
        name,
        str(entry["title"]),
        str(papers[entry["paper"]]),
        str(entry.get("note", "")),
        tuple(float(rate) for rate in entry["fps"]),
        tuple(rows),
    )
