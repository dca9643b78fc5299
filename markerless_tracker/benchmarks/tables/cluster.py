"""Runs on the workers of a Dask cluster.

Every worker process segments a recording once, from the same path as on this machine, so that no
images are sent. Apart from the times, the figures are those of a local run.
"""

import socket
import tempfile
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from markerless_tracker.benchmarks.cluster import check_same, code_and_versions, submitted
from markerless_tracker.benchmarks.tables.evidence import Evidence, EvidenceOrder
from markerless_tracker.benchmarks.tables.runs import Run, execute
from markerless_tracker.errors import DatasetError

_KEPT = 2
"""Recordings whose evidence a worker keeps; more while runs use them."""


@dataclass(eq=False)
class _Kept:
    """Evidence on a worker, the folder of its files, and the number of runs that use it."""

    evidence: Evidence
    folder: "tempfile.TemporaryDirectory[str]"
    users: int = 0


_lock = threading.Lock()
_made: dict[EvidenceOrder, _Kept] = {}


def run_all_on(
    scheduler: str, runs: Sequence[Run], order: EvidenceOrder
) -> Iterator[tuple[int, dict[str, Any]]]:
    """Numbers and figures (see `execute`) of runs on one recording, in order of completion.

    Args:
        scheduler: address, such as tcp://host:8786.
        runs: the runs; each worker thread does one at a time.
        order: their common evidence.

    Raises:
        ConfigError: Dask is not installed, the scheduler does not answer or has no worker, or a
            worker has other code or versions.
        TrackerError: a run failed.
    """
    same = code_and_versions()
    calls = [(run, order, same) for run in runs]
    with submitted(scheduler, execute_there, calls) as answers:
        for number, answer in answers:
            yield number, answer()


def execute_there(run: Run, order: EvidenceOrder, same: Mapping[str, str]) -> dict[str, Any]:
    """Do a run on a worker: see `execute`.

    Args:
        run: the run.
        order: its evidence.
        same: required code and versions (`code_and_versions`).

    Raises:
        ConfigError: the worker's code or versions differ.
        TrackerError: the run failed.
    """
    check_same(same)
    with _evidence(order) as evidence:
        return execute(run, evidence)


@contextmanager
def _evidence(order: EvidenceOrder) -> Iterator[Evidence]:
    """The evidence of an order, made at its first use; those in use and the latest are kept."""
    with _lock:
        if order not in _made:
            folder = tempfile.TemporaryDirectory(prefix="markerless_tracker_")
            try:
                _made[order] = _Kept(order.make(Path(folder.name)), folder)
            except DatasetError as error:
                raise DatasetError(f"worker {socket.gethostname()}: {error}") from error
        kept = _made[order]
        kept.users += 1
        _remove_unused()
    try:
        yield kept.evidence
    finally:
        with _lock:
            kept.users -= 1
            _remove_unused()


def _remove_unused() -> None:
    """Remove the oldest evidence that no run uses, until `_KEPT` are left."""
    unused = [order for order, kept in _made.items() if not kept.users]
    for order in unused[: max(0, len(_made) - _KEPT)]:
        _made.pop(order).folder.cleanup()
