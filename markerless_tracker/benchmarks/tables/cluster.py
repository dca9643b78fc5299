"""Runs on the workers of a Dask cluster.

Every worker process makes a recording's evidence once for itself, from the recording at the same
path as here, so that images do not travel and the figures are those of a run here, times apart.
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
"""How long a scheduler may take to answer."""
_KEPT = 2

_lock = threading.Lock()
_made: dict[EvidenceOrder, tuple[Evidence, "tempfile.TemporaryDirectory[str]"]] = {}


def run_all_on(
    scheduler: str, runs: Sequence[Run], order: EvidenceOrder
) -> Iterator[tuple[int, dict[str, Any]]]:
    """Numbers and figures (see `execute`) of runs on one recording, in the order they finish.

    Args:
        scheduler: address, such as tcp://host:8786.
        runs: what to run; one each to a worker's thread at a time.
        order: the evidence they share.

    Raises:
        ConfigError: Dask is not installed, nobody answers, no worker is there, or a worker has
            other code or versions.
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
            f"scheduler {scheduler}: nobody answers there: {' '.join(str(error).split())}"
        ) from error
    with client:
        if not client.nthreads():
            raise ConfigError(f"scheduler {scheduler}: it has no worker")
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
                f"scheduler {scheduler}: a run ended several workers before their time: "
                "killed, or out of memory"
            ) from error
        finally:
            client.cancel(list(futures))


def code_and_versions() -> dict[str, str]:
    """What must not differ between machines: this package's code, and versions by name."""
    return {"code": code_key(), **{name: str(value) for name, value in versions().items()}}


def execute_there(run: Run, order: EvidenceOrder, same: Mapping[str, str]) -> dict[str, Any]:
    """What a worker does: see `execute`.

    Args:
        run: what to run.
        order: the evidence.
        same: code and versions that the worker must share with whoever asks.

    Raises:
        ConfigError: it does not share them.
        TrackerError: the run failed.
    """
    host = socket.gethostname()
    here = code_and_versions()
    differing = [name for name, value in same.items() if here.get(name) != value]
    if differing:
        raise ConfigError(
            f"worker {host}: not the same {', '.join(differing)} as where the table is made, the "
            "figures would not be the same"
        )
    try:
        evidence = _evidence(order)
    except DatasetError as error:
        raise DatasetError(f"worker {host}: {error}") from error
    return execute(run, evidence)


def _evidence(order: EvidenceOrder) -> Evidence:
    """The evidence ordered, made when first asked for; the latest orders are kept."""
    with _lock:
        if order not in _made:
            folder = tempfile.TemporaryDirectory(prefix="markerless_tracker_")
            _made[order] = (order.make(Path(folder.name)), folder)
            while len(_made) > _KEPT:
                # Whoever still reads its files has them open.
                _made.pop(next(iter(_made)))[1].cleanup()
        return _made[order][0]
