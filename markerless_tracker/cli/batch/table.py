"""The summary table of a batch, as text, CSV and JSON."""

import csv
import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.markup import escape
from rich.table import Table

Row = Mapping[str, Any]

COLUMNS = (
    "name", "status", "found", "frames", "tracked", "overlap", "mean_mm", "disagree", "warnings",
    "seconds", "error", "reference_problem", "calibration_problem", "source",
)  # fmt: skip
CSV = "summary.csv"
JSON = "summary.json"


def text_table(rows: Sequence[Row]) -> Table:
    """The rows as a table, with errors in mm if a recording has reference markers."""
    measured = any(row["mean_mm"] is not None for row in rows)
    table = Table()
    table.add_column("recording", overflow="fold")
    table.add_column("found")
    for heading in ("tracked", "overlap", *(["error mm"] if measured else [])):
        table.add_column(heading, justify="right")
    table.add_column("cameras that disagree", overflow="fold")
    table.add_column("seconds", justify="right")
    for row in rows:
        seconds = "" if row["seconds"] is None else f"{row['seconds']:.1f}"
        error_mm = "" if row["mean_mm"] is None else f"{row['mean_mm']:.1f}"
        errors = [error_mm] if measured else []
        if row["status"] != "done":
            name, reason = escape(row["name"]), escape(row["error"])
            table.add_row(name, "failed", "", "", *errors, reason, seconds)
            continue
        table.add_row(
            escape(row["name"]),
            "yes" if row["found"] else "no",
            f"{row['tracked']} of {row['frames']}",
            "" if row["overlap"] is None else f"{row['overlap']:.2f}",
            *errors,
            ", ".join(row["disagree"]) or "none",
            seconds,
        )
    return table


def totals(rows: Sequence[Row]) -> dict[str, int]:
    """Numbers of recordings: all; done, and of these found and done earlier; failed."""
    done = [row for row in rows if row["status"] == "done"]
    return {
        "recordings": len(rows),
        "done": len(done),
        "found": sum(row["found"] for row in done),
        "earlier": sum(row["earlier"] for row in done),
        "failed": len(rows) - len(done),
    }


def write_tables(out: Path, rows: Sequence[Row]) -> None:
    """Write `summary.csv` (`COLUMNS`) and `summary.json` (`totals` and `trials`) into a folder.

    Raises:
        OSError: they cannot be written.
    """
    part = out / f"{CSV}.part"
    with part.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS, extrasaction="ignore", lineterminator="\n")
        writer.writeheader()
        writer.writerows({**row, "disagree": " ".join(row["disagree"])} for row in rows)
    os.replace(part, out / CSV)
    part = out / f"{JSON}.part"
    content = {"totals": totals(rows), "trials": rows}
    part.write_text(json.dumps(content, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    os.replace(part, out / JSON)
