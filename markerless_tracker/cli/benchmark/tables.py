"""`benchmark tables`: error in mm on recordings with reference markers."""

import argparse
import json
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from markerless_tracker.benchmarks.machine import machine
from markerless_tracker.benchmarks.tables import accuracy
from markerless_tracker.benchmarks.tables.papers import PaperRow, choose, read_papers
from markerless_tracker.benchmarks.tables.plots import write_plot
from markerless_tracker.benchmarks.tables.variants import variants
from markerless_tracker.cli.benchmark.arguments import add_kind
from markerless_tracker.cli.benchmark.choices import Group, every_config, groups, varied
from markerless_tracker.cli.benchmark.layout import LEGEND, full_table, legend_of, paper_table
from markerless_tracker.cli.terminal.arguments import count, list_of, not_negative, positive
from markerless_tracker.cli.terminal.bars import progress_bars, warn
from markerless_tracker.errors import ConfigError
from markerless_tracker.libraries import usable_cores
from markerless_tracker.results.result import versions
from markerless_tracker.tracking import TrackerConfig


def add_parser(kinds: "argparse._SubParsersAction[Any]") -> None:
    """Declare the arguments."""
    parser = add_kind(
        kinds,
        "tables",
        "markerless_tracker benchmark tables WALK --truth-score -o out/all",
        "markerless_tracker benchmark tables WALK --table all -o out/papers",
        help="error in mm: presets x optimizers x bodies x refinements x rates x seeds",
        description="Error on recordings with a ground_truth.trc, mean and sd over seeds.",
    )
    parser.add_argument("sources", nargs="+", type=Path, metavar="SOURCE", help="recording")
    parser.add_argument(
        "--table", type=list_of(str), default=(), metavar="LIST",
        help="tables of the papers, with their figures beside ours: all, or names in "
        "config/papers.yaml: sppso_2, sppso_apf, sppso_ablation, hmcpso_2 .. hmcpso_6, "
        "hmcpso_spread",
    )  # fmt: skip
    parser.add_argument(
        "--preset",
        type=list_of(str),
        metavar="LIST",
        help="default: tuned,paper (with --table: paper; or --config's)",
    )
    parser.add_argument(
        "--optimizer", type=list_of(str), metavar="LIST", help="default: sppso (or --config's)"
    )
    parser.add_argument("--body", type=list_of(str), metavar="LIST", help="default: the preset's")
    parser.add_argument(
        "--refinement",
        type=list_of(str),
        metavar="LIST",
        help="contour,none; default: the preset's",
    )
    parser.add_argument(
        "--fps", type=list_of(positive), default=(), metavar="LIST",
        help="rates; default: those of 60,20 that the recording allows",
    )  # fmt: skip
    parser.add_argument("--seeds", type=count, default=6, metavar="N", help="seeds 0..N-1 (6)")
    parser.add_argument(
        "--evaluations",
        type=list_of(count),
        metavar="LIST",
        help="evaluations per frame (default: each optimizer's own)",
    )
    parser.add_argument(
        "--vary", type=varied, action="append", default=[], metavar="KEY=LIST",
        help="rows for several values of any setting; can be repeated",
    )  # fmt: skip
    parser.add_argument("--config", type=Path, metavar="FILE", help="settings (YAML)")
    parser.add_argument(
        "--scale", type=float, default=1.0, metavar="S", help="factor for the images"
    )
    parser.add_argument(
        "--start-noise", type=not_negative, default=0.0, metavar="MM",
        help="sd of normal noise on each coordinate of the first markers",
    )  # fmt: skip
    parser.add_argument(
        "--truth-score", action="store_true", help="also f(truth) - f(result), mean over frames"
    )
    parser.add_argument(
        "--frames", type=count, metavar="N", help="only the recording's first N frames"
    )
    parser.add_argument(
        "--jobs", type=count, default=usable_cores(), metavar="N",
        help="parallel runs (default: one per core)",
    )  # fmt: skip
    parser.add_argument(
        "--scheduler", metavar="ADDRESS",
        help="run on the workers of a Dask cluster, such as tcp://host:8786 (extra [cluster]); the "
        "workers need the recordings at the same paths",
    )  # fmt: skip
    parser.add_argument(
        "-o", dest="out", type=Path, metavar="DIR",
        help="write table.csv, table.json, plots of the error over time (extra [plots]) and a file "
        "per run; stored runs are not repeated",
    )  # fmt: skip
    parser.add_argument("--json", action="store_true", help="print the table as JSON")


def run(args: argparse.Namespace) -> int:
    """Make the tables, print and write them; returns the exit status."""
    chosen = groups(args, choose(read_papers(), args.table) if args.table else ())
    configs = every_config(chosen)
    plan = accuracy.Plan(
        configs=configs,
        rates=args.fps,
        seeds=args.seeds,
        scale=args.scale,
        start_noise_mm=args.start_noise,
        truth_score=args.truth_score,
        frames=args.frames,
        jobs=args.jobs,
        scheduler=args.scheduler,
    )
    # A recording given twice is measured once.
    sources = list({source.resolve(): source for source in args.sources}.values())
    if args.out is not None:
        args.out.mkdir(parents=True, exist_ok=True)
    with progress_bars() as bars:
        rows = accuracy.make_table(sources, plan, store=args.out, progress=_Bars(bars))
    table = {
        "machine": machine(),
        "versions": versions(),
        "jobs": args.jobs,
        "scheduler": args.scheduler,
        "frames_limit": args.frames,
        "configurations": [config.as_mapping() for config in configs],
        "papers": [_published(group) for group in chosen if group.table is not None],
        "rows": rows,
    }
    parts = list(_pieces(args, chosen, configs, rows))
    if args.out is not None:
        accuracy.write_table(args.out, table)
        _plot(args.out / "plots", parts)
    if args.json:
        json.dump(table, sys.stdout, indent=2, allow_nan=False)
        sys.stdout.write("\n")
        return 0
    console = Console(width=None if sys.stdout.isatty() else 200)
    for title, part in parts:
        console.print(part.rendered(title, truth_score=args.truth_score))
    console.print(LEGEND, highlight=False)
    return 0


def _plot(folder: Path, parts: Sequence[tuple[str, "_Part"]]) -> None:
    """Write the plots; a warning if matplotlib is missing.

    A number is appended to a file's name if another recording has the same name.
    """
    names: Counter[str] = Counter()
    try:
        for title, part in parts:
            for name, heading, lines in part.plots(title):
                names[name] += 1
                number = f"_{names[name]}" if names[name] > 1 else ""
                write_plot(folder / f"{name}{number}.png", heading, lines)
    except ConfigError as error:
        print(f"warning: {error}", file=sys.stderr)


def _published(group: Group) -> dict[str, Any]:
    """A paper's table for table.json."""
    table = group.table
    assert table is not None
    return {
        "table": table.name,
        "title": table.title,
        "source": table.source,
        "note": table.note,
        "fps": list(table.rates),
        "rows": [{"settings": row.settings, "theirs": row.theirs} for row in table.rows],
    }


class _Part:
    """A group's rows on one recording."""

    def __init__(self, group: Group, rows: list[tuple[PaperRow | None, dict[str, Any]]]) -> None:
        self.group = group
        self.rows = rows

    def rendered(self, title: str, *, truth_score: bool) -> Table:
        if self.group.table is None:
            return full_table(title, [row for _, row in self.rows], truth_score=truth_score)
        return paper_table(title, self.group.table, self.rows, truth_score=truth_score)

    def plots(self, title: str) -> Iterator[tuple[str, str, list[tuple[str, dict[str, Any]]]]]:
        """Name, title and lines (legend and row) of a plot per rate."""
        table = self.group.table
        for rate in dict.fromkeys(row["fps"] for _, row in self.rows):
            own = [row for _, row in self.rows if row["fps"] == rate]
            words = [own[0]["recording"], table.name if table else "", f"{rate:g}fps"]
            yield (
                "_".join(filter(None, words)),
                f"{table.title if table else title}\n{own[0]['recording']}, {rate:g} frames/s",
                [(legend_of(row), row) for row in own],
            )


def _pieces(
    args: argparse.Namespace,
    chosen: Sequence[Group],
    configs: Sequence[TrackerConfig],
    rows: Sequence[dict[str, Any]],
) -> Iterator[tuple[str, _Part]]:
    """Title and rows of every group on every recording."""
    places = {config: place for place, config in enumerate(configs)}
    for name, source, scale in dict.fromkeys(
        (row["recording"], row["source"], row["scale"]) for row in rows
    ):
        found: dict[int, list[dict[str, Any]]] = {}
        for row in rows:
            if row["source"] == source:
                found.setdefault(row["configuration"], []).append(row)
        if len({row["source"] for row in rows if row["recording"] == name}) > 1:
            name = source
        size = "" if scale == 1.0 else f" at scale {scale:g}"
        noise = f", start disturbed by {args.start_noise:g} mm" if args.start_noise else ""
        seeds = f"{args.seeds} seed{'s' if args.seeds > 1 else ''}"
        for group in chosen:
            names = variants(group.configs)
            own = [
                (paper, {**row, "variant": words})
                for (paper, config), words in zip(group.rows, names, strict=True)
                for row in found[places[config]]
            ]
            yield f"{name}{size}, {seeds}{noise}", _Part(group, own)


class _Bars(accuracy.Progress):
    """Progress on bars that the caller shows."""

    def __init__(self, bars: Progress) -> None:
        self._bars = bars
        self._runs = self._bars.add_task("runs", total=None)
        self._evidence = self._bars.add_task("evidence", total=None, visible=False)

    def observing(self, recording: str, done: int, total: int | None) -> None:
        self._bars.update(
            self._evidence, description=f"evidence of {recording}", completed=done, total=total,
            visible=done != total,
        )  # fmt: skip

    def running(self, done: int, total: int) -> None:
        self._bars.update(self._runs, completed=done, total=total)

    def warn(self, message: str) -> None:
        warn(self._bars.console, message)
