"""Number of threads, and the lock, for numba's parallel loops."""

import threading
import time
from functools import cache

import numba
import numpy as np
from numba import prange

from markerless_tracker.compiled import compiled

# The only threading layer without a further library. It allows one caller at a time.
numba.config.THREADING_LAYER = "workqueue"
ONE_CALLER = threading.Lock()
"""Held while a parallel kernel runs."""

_LAUNCHES = 30
_MARGIN = 3.0
"""Factor for a busy interpreter: threads wake slower than during the measurement."""


def usable_threads(wanted: int) -> int:
    """At least one thread, at most as many as numba started with."""
    return max(1, min(wanted, int(numba.config.NUMBA_NUM_THREADS)))


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
    with ONE_CALLER:
        numba.set_num_threads(threads)
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
