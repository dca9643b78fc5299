"""Parallel runs in separate processes, each with one thread."""

import multiprocessing
import signal
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from typing import Any

import cv2

from markerless_tracker.benchmarks.tables.evidence import Evidence
from markerless_tracker.benchmarks.tables.runs import Run, execute
from markerless_tracker.errors import SearchError


def run_all(
    runs: Sequence[Run], evidence: Evidence, *, processes: int
) -> Iterator[tuple[int, dict[str, Any]]]:
    """Numbers and figures (see `execute`) of runs on one recording, in order of completion.

    With `processes` = 1 they run in this process, in order. Apart from the times, the figures do
    not depend on the number of processes.

    Raises:
        TrackerError: a run failed, or its process died.
    """
    if min(processes, len(runs)) <= 1:
        for number, run in enumerate(runs):
            yield number, execute(run, evidence)
        return
    # Forked children would inherit threads' locks in an unknown state.
    executor = ProcessPoolExecutor(
        min(processes, len(runs)),
        mp_context=multiprocessing.get_context("spawn"),
        initializer=_settle,
    )
    try:
        futures = {
            executor.submit(execute, run, evidence): number for number, run in enumerate(runs)
        }
        for future in as_completed(futures):
            yield futures[future], future.result()
    except BrokenProcessPool as error:
        raise SearchError(
            "the process of a run died: killed, or out of memory; try fewer jobs"
        ) from error
    finally:
        executor.shutdown(wait=True, cancel_futures=True)


def _settle() -> None:
    """One thread for OpenCV; an interrupt ends the process without a traceback."""
    cv2.setNumThreads(1)
    signal.signal(signal.SIGINT, signal.SIG_DFL)
