"""Settings of a process: cores, threads of the libraries, memory that is kept, garbage collection.

A pose has some thirty parameters. For matrices of that size a library's threads only wait for each
other, and take the cores from the threads that work.
"""

import ctypes
import gc
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager

VARIABLES = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
"""They are read when the library is loaded."""
# Parameters of glibc's `mallopt`, and their values in bytes.
_TRIM_THRESHOLD, _KEPT = -1, 256 << 20
_MMAP_THRESHOLD, _LARGEST = -3, 32 << 20
# With less, a thread's heap of 64 MB is unmapped as soon as it is empty.
_TOP_PAD, _SPARE = -2, 16 << 20
_PIECE = 1 << 20
_OLDEST = len(gc.get_threshold()) - 1


def single_threaded() -> None:
    """One thread in BLAS and OpenMP, unless the environment says otherwise.

    For programs, before they import NumPy; without effect afterwards.
    """
    for name in VARIABLES:
        os.environ.setdefault(name, "1")


def keep_freed_memory() -> None:
    """Let glibc keep up to 256 MB of freed memory, unless the environment sets its `malloc`.

    For programs. Images come and go at the cameras' rate. By default their memory is returned to
    the kernel each time, and each page of the next image costs a page fault. Without effect on
    other systems than Linux, and with other C libraries.
    """
    if sys.platform != "linux":
        return
    own = "glibc.malloc." in os.environ.get("GLIBC_TUNABLES", "")
    if own or any(name.startswith("MALLOC_") for name in os.environ):
        return
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:
        mallopt(_TRIM_THRESHOLD, _KEPT)
        mallopt(_MMAP_THRESHOLD, _LARGEST)
        mallopt(_TOP_PAD, _SPARE)


def touch_memory(size_bytes: int) -> None:
    """Make the kernel provide memory for this thread's allocator before it is needed.

    For programs, after `keep_freed_memory` and in the thread that will need the memory. The kernel
    provides new memory page by page, which takes milliseconds for an image in a virtual machine.

    Args:
        size_bytes: memory that will be needed at once.
    """
    pieces = [b"x" * _PIECE for _ in range(size_bytes // _PIECE)]
    pieces.clear()


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


@contextmanager
def collect_new_objects() -> Iterator[None]:
    """Each full collection in this block looks only at what was made since the last one.

    For blocks that make many objects and keep them, such as compilation, which otherwise spends a
    tenth of its time in collections.
    """

    def keep(phase: str, info: dict[str, int]) -> None:
        if phase == "stop" and info["generation"] == _OLDEST:
            gc.freeze()

    gc.callbacks.append(keep)
    try:
        yield
    finally:
        gc.callbacks.remove(keep)
