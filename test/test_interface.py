"""The public names of the package."""

import ast
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

import markerless_tracker


@pytest.mark.parametrize("name", markerless_tracker.__all__)
def test_a_public_name_is_the_one_of_its_module(name: str) -> None:
    value = getattr(markerless_tracker, name)
    assert name in dir(markerless_tracker)
    if name != "__version__":
        module = markerless_tracker._MODULES[name]
        assert value is getattr(import_module(f"markerless_tracker.{module}"), name)


def test_type_checkers_see_the_same_names() -> None:
    tree = ast.parse(Path(markerless_tracker.__file__).read_text(encoding="utf-8"))
    (block,) = [node for node in tree.body if isinstance(node, ast.If)]
    seen = {
        alias.asname: node.module.removeprefix("markerless_tracker.")
        for node in block.body
        for alias in node.names
    }
    assert seen == markerless_tracker._MODULES
    assert (Path(markerless_tracker.__file__).parent / "py.typed").is_file()


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="no attribute 'Trackers'"):
        _ = markerless_tracker.Trackers


def test_importing_the_package_imports_no_library(project_root: Path) -> None:
    code = (
        "import sys, markerless_tracker; "
        "print(sorted({'numpy', 'numba', 'cv2', 'scipy', 'yaml'} & set(sys.modules)))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=project_root
    )
    assert done.stdout.strip() == "[]"
