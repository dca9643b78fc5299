"""The programs set threads and memory of the libraries, unless the user says otherwise."""

import gc
import os
import platform
import subprocess
import sys
import weakref

import pytest

from markerless_tracker.libraries import VARIABLES, collect_new_objects

PROGRAMS = {
    "cli": "from markerless_tracker.cli.main import main; main(['track', '--help'])",
    "tracker": "from markerless_tracker.node.tracker.executable import main; main(['--help'])",
    "player": "from markerless_tracker.node.player.executable import main; main(['--help'])",
}

PROCESSES = (
    "from markerless_tracker.tracking.processes.tracker_process_main import main; main(0, 0, 0)",
    "from markerless_tracker.tracking.evidence.segmenting_main import main; main(0)",
)
"""The tracker's own processes."""


def threads(program: str, given: dict[str, str]) -> list[str]:
    """The variables at the moment at which NumPy is imported, and at the end."""
    code = (
        "import os, sys\n"
        "class Finder:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        "        if name == 'numpy':\n"
        f"            print('found', *[os.environ.get(n) for n in {VARIABLES}], file=sys.stderr)\n"
        "sys.meta_path.insert(0, Finder())\n"
        "try:\n"
        f"    {program}\n"
        "except SystemExit:\n"
        "    pass\n"
        "import numpy\n"
    )
    own = {k: v for k, v in os.environ.items() if k not in VARIABLES}
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, env=own | given, check=True
    )
    return next(line.split()[1:] for line in done.stderr.splitlines() if line.startswith("found"))


@pytest.mark.parametrize("name", PROGRAMS)
def test_one_thread_when_numpy_is_imported(name) -> None:
    assert threads(PROGRAMS[name], {}) == ["1"] * len(VARIABLES)


def test_what_the_user_says_stays() -> None:
    assert threads(PROGRAMS["cli"], {"OMP_NUM_THREADS": "3"}) == ["1", "3", "1"]


def faults(before: str, given: dict[str, str]) -> int:
    """Page faults of 100 images of 1 MB, of which 4 exist at a time."""
    code = (
        "import resource\n"
        f"{before}\n"
        "images = [bytes(1 << 20) for _ in range(4)]\n"
        "first = resource.getrusage(resource.RUSAGE_SELF).ru_minflt\n"
        "for _ in range(25):\n"
        "    images.clear()\n"
        "    images += [b'x' * (1 << 20) for _ in range(4)]\n"
        "print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - first)\n"
    )
    own = {k: v for k, v in os.environ.items() if not k.startswith(("MALLOC_", "GLIBC_"))}
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, env=own | given, check=True
    )
    return int(done.stdout)


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="sets glibc's malloc only")
def test_freed_images_cost_no_page_faults() -> None:
    keep = "from markerless_tracker.libraries import keep_freed_memory; keep_freed_memory()"
    kept = faults(keep, {})
    for name, value in (
        ("MALLOC_TRIM_THRESHOLD_", "131072"),
        ("GLIBC_TUNABLES", "glibc.malloc.trim_threshold=131072"),
    ):
        # What the user says stays.
        assert 4 * kept < faults(keep, {name: value})


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="sets glibc's malloc only")
def test_images_in_touched_memory_cost_no_page_faults() -> None:
    code = (
        "import resource, sys\n"
        "from markerless_tracker.libraries import keep_freed_memory, touch_memory\n"
        "keep_freed_memory()\n"
        "touch_memory(int(sys.argv[1]) << 20)\n"
        "first = resource.getrusage(resource.RUSAGE_SELF).ru_minflt\n"
        "images = [b'x' * (3 << 20) for _ in range(10)]\n"
        "print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - first)\n"
    )
    own = {k: v for k, v in os.environ.items() if not k.startswith(("MALLOC_", "GLIBC_"))}
    touched, untouched = (
        int(subprocess.check_output([sys.executable, "-c", code, size], text=True, env=own))
        for size in ("64", "0")
    )
    assert 20 * touched < untouched


@pytest.mark.parametrize("program", [*PROGRAMS.values(), *PROCESSES])
def test_programs_keep_freed_memory(program) -> None:
    code = (
        "import markerless_tracker.libraries as libraries\n"
        "libraries.keep_freed_memory = lambda: exit('kept')\n"
        f"{program}"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stderr == "kept\n"


def test_full_collections_look_at_new_objects_only() -> None:
    before = gc.get_freeze_count()

    class Ring:
        """Refers to itself, so that only the collector frees it."""

        def __init__(self) -> None:
            self.itself = self

    kept = Ring()
    lost = weakref.ref(Ring())
    gone: list[object] = []
    weakref.finalize(kept, gone.append, 1)
    with collect_new_objects():
        gc.collect()
        # What is garbage before a collection is freed by it; what is left is looked at no more.
        assert lost() is None
        assert gc.get_freeze_count() > before
        del kept
        gc.collect()
        assert not gone
        again = weakref.ref(Ring())
        gc.collect()
        assert again() is None
    callbacks = len(gc.callbacks)
    gc.unfreeze()
    gc.collect()
    assert gone
    with collect_new_objects():
        assert len(gc.callbacks) == callbacks + 1
    assert len(gc.callbacks) == callbacks
