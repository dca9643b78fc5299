"""`benchmark tables`: tables for people, with the papers' figures beside ours."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.table import Table

from markerless_tracker.benchmarks.tables.papers import PaperRow, PaperTable
from markerless_tracker.benchmarks.tables.runs import LOST_LIMB_MM

Row = Mapping[str, Any]

LEGEND = (
    "mm; mean and limbs: mean ± sd over the seeds; largest frame mean, worst joint, worst "
    "joint of the last frame and frames in a row with a joint more than "
    f"{LOST_LIMB_MM:g} mm off: maximum over the seeds. Evaluations of the swarm and "
    "iterations of refinement are per frame; frames/s, ms/eval.: one thread, evidence given."
)


def full_table(title: str, rows: Sequence[Row], *, truth_score: bool) -> Table:
    """A table with all figures of rows of one recording."""
    table = Table(title=title)
    headings = ["preset", "optimizer", "body", "refinement"]
    if any(row["variant"] for row in rows):
        headings.append("variant")
    for heading in headings:
        table.add_column(heading)
    columns = [
        "fps", "frames", "eval.", "iter.", "mean", "max frame", "worst joint", "limbs",
        "last frame", f"> {LOST_LIMB_MM:g} mm", "frames/s",
    ]  # fmt: skip
    for heading in (*columns, *(["f truth-result"] if truth_score else [])):
        table.add_column(heading, justify="right")
    for row in rows:
        cells = [
            *_names(row, headings),
            f"{row['fps']:g}",
            str(row["frames"]),
            f"{row['evaluations']:.0f}",
            f"{row['refinements']:.1f}",
            _spread(row["mean_mm"], row["sd_mm"]),
            f"{row['max_mm']:.1f}",
            f"{row['worst_joint_mm']:.0f}",
            _spread(row["limbs_mm"], row["limbs_sd_mm"]),
            f"{row['last_joint_mm']:.0f}",
            str(row["lost_run"]),
            f"{row['frames_per_s']:.1f}",
        ]
        table.add_row(*cells, *([_difference(row)] if truth_score else []))
    return table


def paper_table(
    title: str,
    paper: PaperTable,
    rows: Iterable[tuple[PaperRow | None, Row]],
    *,
    truth_score: bool,
) -> Table:
    """Rows in a paper's layout: our figures, then those that the paper prints for its own data."""
    # Sorted by rate, as in the papers.
    found = sorted(rows, key=lambda pair: -pair[1]["fps"])
    table = Table(title=f"{paper.title}\n{title}", caption=_caption(paper))
    headings = ["optimizer", "body", "refinement"]
    if len({row["preset"] for _, row in found}) > 1:
        headings.insert(0, "preset")
    if any(row["variant"] for _, row in found):
        headings.append("variant")
    for heading in headings:
        table.add_column(heading)
    columns = ["fps", "eval.", "mean", "max", f"> {LOST_LIMB_MM:g} mm", "ms/eval.", "s/frame"]
    for heading in (*columns, *(["f truth-result"] if truth_score else [])):
        table.add_column(heading, justify="right")
    for name in paper.recordings:
        table.add_column(f"theirs:\n{name}", justify="right", style="dim")
    for one, row in found:
        known = one.theirs if one is not None and row["fps"] in paper.rates else {}
        cells = [
            *_names(row, headings),
            f"{row['fps']:g}",
            f"{row['evaluations']:.0f}",
            _spread(row["mean_mm"], row["sd_mm"]),
            f"{row['max_mm']:.1f}",
            str(row["lost_run"]),
            "-" if row["ms_per_evaluation"] is None else f"{row['ms_per_evaluation']:.3f}",
            f"{1.0 / row['frames_per_s']:.3f}",
            *([_difference(row)] if truth_score else []),
            *(printed(known.get(name, {})) for name in paper.recordings),
        ]
        table.add_row(*cells)
    return table


def printed(figures: Mapping[str, float]) -> str:
    """A paper's figures as the text of one cell; '' without any."""
    words = []
    if "mean_mm" in figures:
        spread = f" ± {figures['sd_mm']:g}" if "sd_mm" in figures else ""
        words.append(f"{figures['mean_mm']:g}{spread}")
    if "max_mm" in figures:
        words.append(f"max {figures['max_mm']:g}")
    if "ms_per_evaluation" in figures:
        words.append(f"{figures['ms_per_evaluation']:g} ms")
    if "s_per_frame" in figures:
        words.append(f"{figures['s_per_frame']:g} s")
    return ", ".join(words)


def legend_of(row: Row) -> str:
    """Legend of a row's line in a plot."""
    words = [row["optimizer"], row["variant"], f"{row['evaluations']:.0f} eval."]
    return " ".join(
        [*filter(None, words), Path(row["body"]).stem, row["refinement"], f"({row['preset']})"]
    )


def _caption(paper: PaperTable) -> str:
    rates = " and ".join(f"{rate:g}" for rate in paper.rates)
    said = f"; {paper.note}" if paper.note else ""
    theirs = f"theirs: as printed, their data, {rates} frames/s: " if paper.recordings else ""
    return f"{theirs}{paper.source}{said}"


def _names(row: Row, headings: Sequence[str]) -> list[str]:
    return [Path(row[name]).stem if name == "body" else str(row[name]) for name in headings]


def _difference(row: Row) -> str:
    difference = row["truth_difference"]
    return "-" if difference is None else f"{difference:+.4f}"


def _spread(mean: float | None, sd: float | None) -> str:
    if mean is None:
        return "-"
    return f"{mean:.1f}" if sd is None else f"{mean:.1f} ± {sd:.1f}"
