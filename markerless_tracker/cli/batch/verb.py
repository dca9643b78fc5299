"""Verb `batch`: arguments, progress and output."""

import argparse
import fcntl
import json
import shutil
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rich.console import Console

from markerless_tracker.cli.batch.cluster import on_cluster
from markerless_tracker.cli.batch.find import find_recordings
from markerless_tracker.cli.batch.plan import plan
from markerless_tracker.cli.batch.processes import on_processes
from markerless_tracker.cli.batch.table import text_table, totals, write_tables
from markerless_tracker.cli.batch.trial import PARTIAL, RECORDS, Trial
from markerless_tracker.cli.terminal.arguments import count
from markerless_tracker.cli.terminal.bars import progress_bars, tell, warn
from markerless_tracker.cli.track import NO_PERSON_FOUND
from markerless_tracker.cli.track_arguments import add_options
from markerless_tracker.errors import DatasetError
from markerless_tracker.libraries import usable_cores
from markerless_tracker.results.target import SUBJECT, earlier_files, path_of

HELP = (
    "Track the person in every recording of a folder (at any depth) or of a list (a text file with "
    "one path per line). Writes NAME.trc, NAME.json and NAME.subject.yaml of every recording to "
    "OUT, NAME being its path below the folder, and summary.csv and summary.json; the table has "
    "the mean error in mm of recordings with reference markers. A recording that was done with the "
    "same settings is not done again; one that fails costs no other. {source} and {name} in an "
    "option stand for each recording's path and name. Exit status 1: some recordings failed; 3: no "
    "person was found in all recordings."
)
EXAMPLE = "markerless_tracker batch walks -o out --start '{source}/ground_truth.trc'"

_WIDTH = 120


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments: its own and the options of `track`."""
    parser.add_argument(
        "source", metavar="FOLDER|LIST", type=Path, help="folder or list of recordings"
    )
    parser.add_argument(
        "-o", dest="out", type=Path, required=True, metavar="OUT", help="folder of the results"
    )
    parser.add_argument(
        "--jobs", type=count, metavar="N", help="parallel processes (default: one per core)"
    )
    parser.add_argument(
        "--scheduler", metavar="ADDRESS",
        help="track on the workers of a Dask cluster, such as tcp://host:8786 (extra [cluster]); "
        "they need the recordings and OUT at the same paths",
    )  # fmt: skip
    parser.add_argument("--json", action="store_true", help="print the summary as JSON")
    parser.add_argument(
        "--force", action="store_true", help="replace results of other settings in OUT"
    )
    add_options(parser)


def run(args: argparse.Namespace) -> int:
    """Track; returns 0, 1 if recordings failed, or 3 if no person was found in all of them."""
    found = find_recordings(args.source, without=args.out)
    cores = usable_cores()
    jobs = min(args.jobs or cores, len(found))
    trials = plan(args, found, threads=1 if args.scheduler else max(1, cores // jobs))
    with _alone(args.out):
        rows: dict[str, dict[str, Any]] = {}
        for trial in trials:
            if (done := trial.done()) is not None:
                rows[trial.name] = {**done.row, "earlier": True}
        missing = [trial for trial in trials if trial.name not in rows]
        if not args.force:
            _check_targets(missing)
        try:
            for row in _done(args, missing, jobs, len(rows)):
                rows[row["name"]] = {**row, "earlier": False}
        finally:
            # The tables of an interrupted batch contain its completed trials.
            table = [rows[trial.name] for trial in trials if trial.name in rows]
            write_tables(args.out, table)
    numbers = totals(table)
    if args.json:
        json.dump({"totals": numbers, "trials": table}, sys.stdout, indent=2, allow_nan=False)
        sys.stdout.write("\n")
    else:
        Console(width=None if sys.stdout.isatty() else _WIDTH).print(text_table(table))
        print(
            f"{numbers['recordings']} recordings: {numbers['done']} done ({numbers['earlier']} of "
            f"them earlier), a person found in {numbers['found']}, {numbers['failed']} failed"
        )
    failures = [row for row in table if row["status"] != "done"]
    if failures:
        _tell(
            f"{len(failures)} of {len(table)} recordings failed, the first: {failures[0]['name']}: "
            f"{failures[0]['error']}"
        )
        return 1
    if numbers["found"]:
        return 0
    _tell(f"no person was found in {len(table)} of {len(table)} recordings")
    return NO_PERSON_FOUND


def _done(
    args: argparse.Namespace, missing: Sequence[Trial], jobs: int, earlier: int
) -> Iterator[dict[str, Any]]:
    """Rows of the missing trials as they are completed, with a progress bar."""
    if not missing:
        return
    with progress_bars() as bars:
        task = bars.add_task("recordings", total=earlier + len(missing), completed=earlier)
        rows = (
            on_processes(missing, jobs)
            if args.scheduler is None
            else on_cluster(missing, args.scheduler)
        )
        for trial, row in rows:
            if row["error"] is not None:
                warn(bars.console, f"{trial.name} failed: {row['error']}")
            elif row["reference_problem"] is not None:
                warn(bars.console, f"{trial.name}: no error in mm: {row['reference_problem']}")
            if row["calibration_problem"] is not None:
                refined = trial.arguments["refine_calibration"]
                warn(bars.console, f"{refined}: not written: {row['calibration_problem']}")
            if row["overlap"] is not None:
                bars.update(task, note=f"overlap {row['overlap']:.2f}")
            bars.advance(task)
            yield row


def _check_targets(missing: Sequence[Trial]) -> None:
    """Check that nothing would be replaced that is not of this batch.

    That is a result of other settings, a calibration or a subject file.
    """
    for trial in missing:
        refined = trial.arguments["refine_calibration"]
        if refined is not None and refined.exists() and not trial.record.exists():
            raise DatasetError(f"{refined}: exists already, expected a new name or --force")
        target = trial.out / trial.name
        there, stored = earlier_files(target), trial.stored()
        other = stored is not None and stored.key != trial.key
        subject = path_of(target, SUBJECT)
        if subject.exists() and subject.name not in trial.written():
            raise DatasetError(
                f"{subject}: exists already and is of no result of this batch, expected another "
                "OUT or --force"
            )
        if other or (there and not trial.record.exists()):
            path = there[0] if there else path_of(target, ".json")
            raise DatasetError(
                f"{path}: exists already and is of other settings, code or images, expected the "
                "same, another OUT or --force"
            )


@contextmanager
def _alone(out: Path) -> Iterator[None]:
    """Lock the folder of the results for this batch, and remove leftovers of killed trials."""
    records = out / RECORDS
    try:
        records.mkdir(parents=True, exist_ok=True)
        with (records / "lock").open("w", encoding="utf-8") as file:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError as error:
                raise DatasetError(
                    f"{out}: another batch is writing there, expected another OUT"
                ) from error
            _sweep(records)
            try:
                yield
            finally:
                _sweep(records)
    except OSError as error:
        raise DatasetError(f"{error.filename or out}: {error.strerror or error}") from error


def _sweep(records: Path) -> None:
    for folder in records.glob(f"{PARTIAL}*"):
        shutil.rmtree(folder, ignore_errors=True)


def _tell(text: str) -> None:
    tell(Console(stderr=True), text)
