"""One trial of a batch: `track` on one recording, in any process.

A trial writes to a folder of its own. Its complete files are moved to their final paths, and the
row of its record is written last. A trial is done if its record has a row.
"""

import argparse
import json
import os
import shutil
import tempfile
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from statistics import fmean
from typing import Any, NamedTuple

import cv2

from markerless_tracker.cli.terminal.notices import COMPILING, Notices
from markerless_tracker.cli.track import Finished, track_source
from markerless_tracker.datasets import read_trc
from markerless_tracker.errors import CalibrationError, TrackerError, one_line
from markerless_tracker.results.score import score
from markerless_tracker.results.stored import stored_frames
from markerless_tracker.results.target import earlier_files

RECORDS = ".batch"
"""Folder of the records, in the folder of the results."""
PARTIAL = ".partial-"
"""Prefix of the folders in `RECORDS` to which running trials write."""


@dataclass(frozen=True)
class Trial:
    """A recording and the arguments with which it is tracked.

    Attributes:
        name: name of the recording and its result, may have folders.
        source: absolute path of the recording.
        out: absolute path of the batch's results.
        key: key of the recording's files and of everything that the result depends on.
        arguments: arguments of `track` by name, except `source`, `name`, `force` and `json`.
    """

    name: str
    source: Path
    out: Path
    key: str
    arguments: Mapping[str, Any]

    @property
    def record(self) -> Path:
        """File of the record."""
        return self.out / RECORDS / f"{self.name}.json"

    def stored(self) -> "Record | None":
        """The record of this name; None without a readable one."""
        try:
            found = json.loads(self.record.read_text(encoding="utf-8"))
            return Record(str(found["key"]), dict(found["row"]), self.written())
        except (OSError, ValueError, KeyError, TypeError):
            return None

    def written(self) -> tuple[str, ...]:
        """Names of the files that the record lists, of an incomplete result as well."""
        try:
            found = json.loads(self.record.read_text(encoding="utf-8"))
            return tuple(str(name) for name in found["files"])
        except (OSError, ValueError, KeyError, TypeError):
            return ()

    def done(self) -> "Record | None":
        """The record of this very trial, if it is done and its files are there."""
        found, folder = self.stored(), (self.out / self.name).parent
        if found is None or found.key != self.key:
            return None
        return found if all((folder / name).exists() for name in found.files) else None


class Record(NamedTuple):
    """A trial that was done: its key, its row, the names of its files."""

    key: str
    row: dict[str, Any]
    files: tuple[str, ...]


def do_trial(trial: Trial) -> dict[str, Any]:
    """Track a trial's recording and write its result; returns its row of the table.

    If the recording or its processing fails, `error` of the row states why and nothing is written.
    A trial that is done already is not repeated. Keys: `name`, `source`, `status` (done or failed),
    `found`, `frames`, `tracked`, `overlap` (mean over the cameras of the median overlap), `mean_mm`
    (error against the recording's reference markers, None without any), `reference_problem` (why it
    is None in spite of markers), `calibration_problem` (why a requested refinement of the
    calibration was refused, None if none was), `disagree` (names of cameras), `warnings`,
    `seconds`, `error`.
    """
    clock = _Clock()
    stored = trial.stored()
    if (done := trial.done()) is not None:
        return done.row
    cv2.setNumThreads(1)
    try:
        finished, files = _track(trial, stored, clock)
    except Exception as error:  # a damaged recording may raise any exception: it costs its trial
        return failed(trial, one_line(error), clock.seconds)
    seconds, summary = clock.seconds, finished.summary
    mean_mm, problem = _mean_error(trial, finished) if summary["tracked"] else (None, None)
    overlap = list(summary["verdict"]["overlap"].values())
    row = {
        "name": trial.name,
        "source": str(trial.source),
        "status": "done",
        "found": summary["tracked"] > 0,
        "frames": summary["frames"],
        "tracked": summary["tracked"],
        "overlap": round(fmean(overlap), 3) if overlap else None,
        "mean_mm": mean_mm,
        "reference_problem": problem,
        "calibration_problem": _calibration_problem(finished),
        "disagree": [name for name, one in summary["cameras"].items() if one["disagrees"]],
        "warnings": len(summary["warnings"]) + len(summary["frame_warnings"]),
        "seconds": round(seconds, 2),
        "error": None,
    }
    try:
        _write(trial.record, {"key": trial.key, "row": row, "files": files})
    except OSError as error:
        return failed(trial, one_line(error), clock.seconds)
    return row


def failed(trial: Trial, error: str, seconds: float | None = None) -> dict[str, Any]:
    """Row of a trial that failed after some seconds with an error of one line."""
    nothing = dict.fromkeys(
        ("found", "frames", "tracked", "overlap", "mean_mm", "reference_problem",
         "calibration_problem")
    )  # fmt: skip
    return {
        "name": trial.name, "source": str(trial.source), "status": "failed", **nothing,
        "disagree": [], "warnings": 0,
        "seconds": None if seconds is None else round(seconds, 2), "error": error,
    }  # fmt: skip


class _Clock(Notices):
    """Time of a trial, without the compilation in the first trial of a process."""

    def __init__(self) -> None:
        self._from = time.perf_counter()
        self._compiling: float | None = None

    def begin(self, part: str, total: int | None = None) -> None:
        now = time.perf_counter()
        if self._compiling is not None:
            self._from += now - self._compiling
        self._compiling = now if part == COMPILING else None

    @property
    def seconds(self) -> float:
        """Time so far, s."""
        return time.perf_counter() - self._from


def _track(trial: Trial, earlier: Record | None, clock: _Clock) -> tuple[Finished, list[str]]:
    """Track and move the files to their final paths; returns the run and the files' names."""
    target = trial.out / trial.name
    target.parent.mkdir(parents=True, exist_ok=True)
    trial.record.parent.mkdir(parents=True, exist_ok=True)
    folder = Path(tempfile.mkdtemp(prefix=PARTIAL, dir=trial.out / RECORDS))
    try:
        chosen = argparse.Namespace(
            **trial.arguments, source=trial.source, name=folder / target.name, force=True
        )
        finished = track_source(chosen, clock)
        files = sorted(file.name for file in folder.iterdir())
        # The record has no row, since from here on neither result is complete.
        _write(trial.record, {"key": trial.key, "files": files})
        for name in earlier.files if earlier is not None else ():
            (target.parent / name).unlink(missing_ok=True)
        for path in earlier_files(target):
            path.unlink()
        for name in files:
            os.replace(folder / name, target.parent / name)
        return finished, files
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _mean_error(trial: Trial, finished: Finished) -> tuple[float | None, str | None]:
    """Mean error in mm as in `evaluate`, and why it is None in spite of reference markers."""
    path = trial.out / f"{trial.name}.trc"
    try:
        reference = finished.recording.ground_truth()
        if reference is None:
            return None, None
        track = read_trc(path)
        stored = stored_frames(path, track)
        found = score(track if stored is None else stored.track, reference)
    except TrackerError as error:
        # The result itself is complete.
        return None, one_line(error)
    return round(found.mean_mm, 2), None


def _calibration_problem(finished: Finished) -> str | None:
    """Why the refinement of the calibration was refused; None without a tracked person."""
    if isinstance(finished.refined, CalibrationError) and finished.summary["tracked"]:
        return one_line(finished.refined)
    return None


def _write(path: Path, content: Mapping[str, Any]) -> None:
    part = path.with_name(path.name + ".part")
    part.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    os.replace(part, path)
