"""Number of threads, and the lock, for numba's parallel loops."""

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache

import numba
import numpy as np
from numba import prange

from markerless_tracker.compiled import compiled

_LAYER = "workqueue"
"""The only threading layer without a library to install. It takes one caller at a time."""
_ONE_CALLER = threading.Lock()
_LAUNCHES = 30
_MARGIN = 3.0
"""Factor for a busy interpreter: threads wake slower than during the measurement."""


def usable_threads(wanted: int) -> int:
    """At least one thread, at most as many as numba started with."""
    return max(1, min(wanted, int(numba.config.NUMBA_NUM_THREADS)))


@contextmanager
def parallel(threads: int) -> Iterator[None]:
    """Run a parallel kernel in this block: one caller at a time, with some threads.

    The first block chooses numba's threading layer, which holds for the whole process, unless the
    process has chosen or started one.
    """
    with _ONE_CALLER:
        if numba.config.THREADING_LAYER == "default" and not _layer_started():
            numba.config.THREADING_LAYER = _LAYER
        numba.set_num_threads(threads)
        yield


def _layer_started() -> bool:
    try:
        numba.threading_layer()
    except ValueError:
        return False
    return True


def worth_waking(work_s: float, threads: int) -> bool:
    """Whether several threads finish sooner than one that takes `work_s` alone.

    Waking threads costs between some 10 and some 100 µs, so small batches run on one thread.
    The answer may differ between machines; results do not depend on the number of threads.
    """
    return threads > 1 and work_s * (1.0 - 1.0 / threads) > _MARGIN * launch_cost_s(threads)


@cache
def launch_cost_s(threads: int) -> float:
    """Time to wake that many threads on this machine; measured once."""
    ticks = np.zeros(threads)
    costs = []
    with parallel(threads):
        _nothing(ticks)
        for _ in range(_LAUNCHES):
            # Workers sleep between the swarm's steps.
            time.sleep(0.0002)
            begin = time.perf_counter()
            _nothing(ticks)
            costs.append(time.perf_counter() - begin)
    return float(np.median(costs))


@compiled(parallel=True)
def _nothing(ticks):  # type: ignore[no-untyped-def]
    for thread in prange(ticks.size):
        ticks[thread] += 1.0
