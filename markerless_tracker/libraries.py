"""Cores, threads of the numerical libraries (none beside the package's own), and collections.

A pose has some thirty parameters. For matrices of that size a library's threads only wait for each
other, and take the cores from the threads that work.
"""

import gc
import os

VARIABLES = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
"""They are read when the library is loaded."""


def single_threaded() -> None:
    """One thread in BLAS and OpenMP, unless the environment says otherwise.

    For programs, before they import NumPy; without effect afterwards.
    """
    for name in VARIABLES:
        os.environ.setdefault(name, "1")


def quiet_decoders() -> None:
    """No lines of FFmpeg on standard error, unless the environment asks for them.

    For programs, before they open a video: the package's own error names the file.
    """
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")


def usable_cores() -> int:
    """Cores that this process may run on."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def collect_for_good() -> None:
    """Collect garbage now, and look at no object that is left again.

    For programs, after their preparations: the libraries' objects are some hundred thousand, and a
    collection that looks at all of them holds every thread up for a tenth of a second.
    """
    gc.collect()
    gc.freeze()
