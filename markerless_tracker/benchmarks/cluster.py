"""Function calls on the workers of a Dask cluster."""

import socket
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from typing import Any

from markerless_tracker.benchmarks.tables.fingerprint import code_key
from markerless_tracker.errors import ConfigError, SearchError
from markerless_tracker.results.result import versions

ANSWER_S = 10.0
"""Timeout for the scheduler's answer, s."""

Answers = Iterator[tuple[int, Callable[[], Any]]]


@contextmanager
def submitted(
    scheduler: str, function: Callable[..., Any], calls: Sequence[tuple[Any, ...]]
) -> Iterator[Answers]:
    """Calls of a function on the workers of a cluster; they are cancelled when the block ends.

    Yields, in order of completion, the number of each call and a function that returns its value or
    raises its error. That function raises SearchError if the call's workers died.

    Args:
        scheduler: address, such as tcp://host:8786.
        function: runs on the workers; each worker thread runs one call at a time.
        calls: arguments of each call.

    Raises:
        ConfigError: Dask is not installed, or the scheduler does not answer or has no worker.
    """
    try:
        from distributed import Client, as_completed
        from distributed.comm.addressing import parse_address, parse_host_port
    except ImportError as error:
        raise ConfigError(
            f"scheduler {scheduler}: the package distributed is not installed here, "
            "expected markerless_tracker[cluster]"
        ) from error
    try:
        # A client with a wrong address would leave a thread that waits for an answer.
        parse_host_port(parse_address(scheduler)[1])
        client = Client(scheduler, timeout=ANSWER_S, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        raise ConfigError(
            f"scheduler {scheduler}: no answer: {' '.join(str(error).split())}"
        ) from error
    with client:
        if not client.nthreads():
            raise ConfigError(f"scheduler {scheduler}: it has no worker, expected at least one")
        futures = {
            client.submit(function, *call, pure=False): number for number, call in enumerate(calls)
        }
        try:
            yield (
                (futures[future], partial(_answer, scheduler, future))
                for future in as_completed(futures, loop=client.loop)
            )
        finally:
            client.cancel(list(futures))


def _answer(scheduler: str, future: Any) -> Any:
    from distributed import KilledWorker

    try:
        return future.result()
    except KilledWorker as error:
        raise SearchError(
            f"scheduler {scheduler}: several workers died in a run: killed, or out of memory"
        ) from error


def code_and_versions() -> dict[str, str]:
    """Key of this package's code, and versions by name; they must be equal on all machines."""
    return {"code": code_key(), **{name: str(value) for name, value in versions().items()}}


def check_same(same: Mapping[str, str]) -> None:
    """Check that this worker has the code and the versions of the calling machine.

    Args:
        same: `code_and_versions` of that machine.

    Raises:
        ConfigError: the worker's differ; names the differences.
    """
    here = code_and_versions()
    differing = [name for name, value in same.items() if here.get(name) != value]
    if differing:
        raise ConfigError(
            f"worker {socket.gethostname()}: {', '.join(differing)} differ from those of the "
            "machine that asks, expected the same"
        )
