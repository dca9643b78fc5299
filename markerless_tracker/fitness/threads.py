"""Threads for the cameras and for large batches of evaluations; when they save time.

Compiled kernels release the interpreter's lock, so Python threads suffice. Numba's own threads
would need every kernel compiled a second time, and serve one caller at a time.
"""

import os
import time
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor, wait
from functools import cache
from itertools import count
from typing import Any

import numpy as np

_LAUNCHES = 30
_MARGIN = 3.0
"""Factor for a busy interpreter: threads wake slower than during the measurement."""


def usable_threads(wanted: int) -> int:
    """At least one thread, at most as many as the machine has cores."""
    return 1 if wanted <= 1 else min(wanted, os.cpu_count() or 1)


def side_by_side(work: Callable[[int], object], threads: int) -> None:
    """Run work(0) .. work(threads - 1) at the same time, the first on the calling thread."""
    pool = _pool(threads - 1, os.getpid()) if threads > 1 else None
    others = [pool.submit(work, thread) for thread in range(1, threads)] if pool else []
    work(0)
    for other in others:
        other.result()


def mapper(threads: int) -> Callable[..., Iterable[Any]]:
    """A `map` that shares the items among threads, of which the calling one is the first.

    If the caller slept meanwhile, two threads would often be woken on one core, and another core
    would idle for milliseconds.

    Of the errors that items raise, that of the first item is raised.

    Args:
        threads: with 1, `map` itself.
    """
    if threads <= 1:
        return map
    pool = ThreadPoolExecutor(threads - 1, thread_name_prefix="map")

    def shared_map(work: Callable[[Any], Any], items: Iterable[Any]) -> list[Any]:
        todo, numbers = list(items), count()
        done: list[Any] = [None] * len(todo)
        failed: dict[int, Exception] = {}

        def take() -> None:
            while (number := next(numbers)) < len(todo):
                try:
                    done[number] = work(todo[number])
                except Exception as error:
                    failed[number] = error

        others = [pool.submit(take) for _ in range(min(threads, len(todo)) - 1)]
        try:
            take()
        finally:
            # A thread that has not begun has nothing left to do, and may be busy for long.
            wait([other for other in others if not other.cancel()])
        if failed:
            raise failed[min(failed)]
        return done

    return shared_map


@cache
def _pool(threads: int, process: int) -> ThreadPoolExecutor:
    """The pool of a process; keyed by process, since a forked process has none of the threads."""
    return ThreadPoolExecutor(max_workers=threads, thread_name_prefix="fitness")


def worth_waking(work_s: float, threads: int) -> bool:
    """Whether several threads finish sooner than one thread, which takes `work_s`.

    Waking threads costs some 10 to some 100 µs, so small batches run on one thread. The answer may
    differ between machines; results do not depend on the number of threads.
    """
    return threads > 1 and work_s * (1.0 - 1.0 / threads) > _MARGIN * launch_cost_s(threads)


@cache
def launch_cost_s(threads: int) -> float:
    """Time to wake `threads` threads on this machine; measured once."""
    costs = []
    for _ in range(_LAUNCHES):
        # Threads sleep between batches.
        time.sleep(0.0002)
        begin = time.perf_counter()
        side_by_side(lambda thread: None, threads)
        costs.append(time.perf_counter() - begin)
    return float(np.median(costs))
