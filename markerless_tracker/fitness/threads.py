"""The one way into numba's parallel loops."""

import threading

import numba

# The only threading layer without a library to install. It takes one caller at a time.
numba.config.THREADING_LAYER = "workqueue"
ONE_CALLER = threading.Lock()
"""Held while a parallel kernel runs."""


def usable_threads(wanted: int) -> int:
    """At least one thread, at most as many as numba started with."""
    return max(1, min(wanted, int(numba.config.NUMBA_NUM_THREADS)))
