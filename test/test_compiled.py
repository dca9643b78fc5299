"""Stored kernels: named after all sources that they are compiled from, and after numba."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from markerless_tracker import compiled
from markerless_tracker.compiled import PACKAGE, kernel_sources, source_digest

PROGRAM = """
import sys
sys.path.insert(0, sys.argv[1])
from small import upper
print(upper.twice_and_one(3.0), upper.twice_and_one.stats.cache_hits)
"""


def run(folder: Path) -> str:
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, str(folder)], capture_output=True, text=True, check=True
    )
    return done.stdout.strip()


def test_an_edit_in_a_kernel_that_another_file_calls_is_noticed(tmp_path: Path) -> None:
    """Our `compiled.py` in a package of two files, one calling the other."""
    package = tmp_path / "small"
    package.mkdir()
    (package / "__init__.py").touch()
    (package / "compiled.py").write_text((PACKAGE / "compiled.py").read_text())
    numbers = package / "numbers.py"
    numbers.write_text("FACTOR = 1.0\n")
    lower, upper = package / "lower.py", package / "upper.py"
    head = "from small.compiled import compiled\nfrom small.numbers import FACTOR\n"
    function = "\n@compiled()\ndef twice(x):\n    return {} * x\n"
    lower.write_text(head + function.format("2.0 * FACTOR"))
    upper.write_text(
        head + "from small.lower import twice\n"
        "\n@compiled()\ndef twice_and_one(x):\n    return twice(x) + 1.0\n"
    )
    assert run(tmp_path) == "7.0 Counter()"
    assert run(tmp_path).startswith("7.0 Counter({") and "1" in run(tmp_path)
    lower.write_text(head + function.format("5.0"))
    assert run(tmp_path) == "16.0 Counter()"
    assert run(tmp_path).startswith("16.0 Counter({")
    lower.write_text(head + function.format("5.0 * FACTOR"))
    numbers.write_text("FACTOR = 0.2\n")
    assert run(tmp_path) == "4.0 Counter()"


COUNTING = """
import sys
sys.path.insert(0, sys.argv[1])
from small.compiled import compilation, compiled
@compiled()
def half(x):
    return 0.5 * x
@compiled()
def quarter(x):
    return half(half(x))
def show(*told):
    print(*told)
if __name__ == "__main__":
    with compilation(show) as counted:
        quarter(8.0), quarter(4.0)
    print("done", counted.done)
    half(1)
"""


def test_the_progress_of_a_compilation(tmp_path: Path) -> None:
    package = tmp_path / "small"
    package.mkdir()
    (package / "__init__.py").touch()
    (package / "compiled.py").write_text((PACKAGE / "compiled.py").read_text())
    program = tmp_path / "program.py"
    program.write_text(COUNTING)

    def told() -> list[str]:
        done = subprocess.run(
            [sys.executable, str(program), str(tmp_path)],
            capture_output=True, text=True, check=True,
        )  # fmt: skip
        return done.stdout.splitlines()

    assert told() == ["quarter 0 2", "half 0 2", "half 1 2", "quarter 2 2", "done 2"]
    # What is stored is not compiled again.
    assert told() == ["done 0"]


LEVELS = """
import numpy as np
from numba import njit
from numba.core import config, event
from markerless_tracker.fitness.raster.bits import count_bits
levels = set()
class Passes(event.Listener):
    def on_start(self, event):
        levels.add(int(config.OPT))
    def on_end(self, event):
        pass
def half(x):
    return 0.5 * x
event.register("numba:run_pass", Passes())
count_bits(np.zeros((2, 3), np.uint64))
ours = set(levels)
levels.clear()
njit(half)(8.0)
print(ours, levels, int(config.OPT))
"""


@pytest.mark.parametrize(("level", "expected"), [(None, "{2} {3} 3"), ("1", "{1} {1} 1")])
def test_only_our_kernels_have_a_lower_level(
    level: str | None, expected: str, tmp_path: Path
) -> None:
    environment = {name: value for name, value in os.environ.items() if name != "NUMBA_OPT"}
    environment["NUMBA_CACHE_DIR"] = str(tmp_path)
    if level is not None:
        environment["NUMBA_OPT"] = level
    done = subprocess.run(
        [sys.executable, "-c", LEVELS], capture_output=True, text=True, check=True, env=environment
    )
    assert done.stdout.strip() == expected


def test_a_kernel_depends_on_kernels_constants_and_named_tuples_that_it_imports() -> None:
    sources = kernel_sources(PACKAGE / "fitness" / "raster" / "kernels.py")
    names = {file.relative_to(PACKAGE).as_posix() for file in sources}
    assert {"fitness/raster/kernels.py", "fitness/raster/fill.py", "body/kinematics.py"} <= names
    assert not {"errors.py", "records.py", "imaging/segmentation/kernels.py"} & names
    assert len(source_digest(PACKAGE / "fitness" / "raster" / "kernels.py")) == 12


def test_another_numba_stores_its_kernels_beside(monkeypatch: pytest.MonkeyPatch) -> None:
    file = PACKAGE / "fitness" / "raster" / "kernels.py"
    digest = source_digest.__wrapped__
    mine = digest(file)
    monkeypatch.setattr(compiled, "numba_version", "0.0.1")
    assert digest(file) != mine


def test_no_kernel_is_compiled_past_the_digest() -> None:
    for file in PACKAGE.rglob("*.py"):
        text = file.read_text(encoding="utf-8")
        assert file.name == "compiled.py" or "njit" not in text, file
