"""The programs give NumPy's libraries one thread, unless the user says otherwise."""

import os
import subprocess
import sys

import pytest

from markerless_tracker.libraries import VARIABLES

PROGRAMS = {
    "cli": "from markerless_tracker.cli.main import main; main(['track', '--help'])",
    "tracker": "from markerless_tracker.node.tracker.executable import main; main(['--help'])",
    "player": "from markerless_tracker.node.player.executable import main; main(['--help'])",
}


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
