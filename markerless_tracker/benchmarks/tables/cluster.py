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

from markerless_tracker.benchmarks.tables.evidence import Evidence, EvidenceOrder
from markerless_tracker.benchmarks.tables.fingerprint import code_key
from markerless_tracker.benchmarks.tables.runs import Run, execute
from markerless_tracker.errors import ConfigError, DatasetError, SearchError
from markerless_tracker.results.result import versions

ANSWER_S = 10.0
"""Timeout for the scheduler's answer, s."""
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
    try:
        from distributed import Client, KilledWorker, as_completed
    except ImportError as error:
        raise ConfigError(
            f"scheduler {scheduler}: the package distributed is not installed here, "
            "expected markerless_tracker[cluster]"
        ) from error
    try:
        client = Client(scheduler, timeout=ANSWER_S, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        raise ConfigError(
            f"scheduler {scheduler}: no answer: {' '.join(str(error).split())}"
        ) from error
    with client:
        if not client.nthreads():
            raise ConfigError(f"scheduler {scheduler}: it has no worker, expected at least one")
        same = code_and_versions()
        futures = {
            client.submit(execute_there, run, order, same, pure=False): number
            for number, run in enumerate(runs)
        }
        try:
            for future in as_completed(futures, loop=client.loop):
                yield futures[future], future.result()
        except KilledWorker as error:
            raise SearchError(
                f"scheduler {scheduler}: several workers died in a run: killed, or out of memory"
            ) from error
        finally:
            client.cancel(list(futures))


def code_and_versions() -> dict[str, str]:
    """What must be equal on all machines: key of this package's code, and versions by name."""
    return {"code": code_key(), **{name: str(value) for name, value in versions().items()}}


def execute_there(run: Run, order: EvidenceOrder, same: Mapping[str, str]) -> dict[str, Any]:
    """Do a run on a worker: see `execute`.

    Args:
        run: the run.
        order: its evidence.
        same: required code and versions (`code_and_versions`).

    Raises:
        ConfigError: the worker has others.
        TrackerError: the run failed.
    """
    host = socket.gethostname()
    here = code_and_versions()
    differing = [name for name, value in same.items() if here.get(name) != value]
    if differing:
        raise ConfigError(
            f"worker {host}: {', '.join(differing)} differ from those of the machine that makes "
            "the table, expected the same"
        )
    try:
        evidence = _evidence(order)
    except DatasetError as error:
        raise DatasetError(f"worker {host}: {error}") from error
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
