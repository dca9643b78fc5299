"""Runs on the workers of a Dask cluster.

Every worker process segments a recording once, from the same path as on this machine, so that no
images are sent. Apart from the times, the figures are those of a local run.
"""

import socket
import tempfile
import threading
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from markerless_tracker.benchmarks.cluster import check_same, code_and_versions, submitted
from markerless_tracker.benchmarks.tables.evidence import Evidence, EvidenceOrder
from markerless_tracker.benchmarks.tables.runs import Run, execute
from markerless_tracker.errors import DatasetError

_KEPT = 2
"""Recordings whose evidence a worker keeps."""

_lock = threading.Lock()
_made: dict[EvidenceOrder, tuple[Evidence, "tempfile.TemporaryDirectory[str]"]] = {}


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
    try:
        evidence = _evidence(order)
    except DatasetError as error:
        raise DatasetError(f"worker {socket.gethostname()}: {error}") from error
    return execute(run, evidence)


def _evidence(order: EvidenceOrder) -> Evidence:
    """The evidence of an order, made at its first use; the latest ones are kept."""
    with _lock:
        if order not in _made:
            folder = tempfile.TemporaryDirectory(prefix="markerless_tracker_")
            _made[order] = (order.make(Path(folder.name)), folder)
            while len(_made) > _KEPT:
                # Runs that read its files hold them open.
                _made.pop(next(iter(_made)))[1].cleanup()
        return _made[order][0]
