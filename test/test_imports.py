"""The rooms: imports point down, rooms on one floor do not know each other."""

import ast
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

PACKAGE = "markerless_tracker"
SOURCE = Path(__file__).resolve().parent.parent / PACKAGE

FLOORS = {
    "cli": 6,
    "node": 5,
    "benchmarks": 5,
    "results": 4,
    "bags": 5,
    "viewing": 5,
    "tracking": 3,
    "fitness": 2,
    "datasets": 2,
    "synthesis": 2,
    "drawing": 2,
    "camera": 1,
    "body": 1,
    "imaging": 1,
    "optim": 1,
    "ground": 0,
}
GROUND = {"", "compiled", "geometry", "records", "errors", "resources", "settings"}
CONFINED = {
    "rosbags": ("bags/", "datasets/bag/"),
    "rclpy": ("node/",),
    "tf2_msgs": ("node/",),
    "sensor_msgs": ("node/",),
    "geometry_msgs": ("node/",),
    "visualization_msgs": ("node/",),
    "diagnostic_msgs": ("node/",),
    "std_msgs": ("node/",),
    "std_srvs": ("node/",),
}


def room(module: str) -> str:
    """Room of a dotted module name of the package."""
    part = module.split(".")[1] if "." in module else ""
    return "ground" if part in GROUND else "cli" if part == "__main__" else part


def imported(tree: ast.AST, module: str) -> Iterator[str]:
    """Dotted names that a module imports, anywhere in it, relative ones resolved."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                above = module.split(".")[: -node.level]
                base = ".".join([*above, base]) if base else ".".join(above)
            yield base
            # "from markerless_tracker import camera" names a room only in its aliases.
            if base == PACKAGE:
                yield from (f"{base}.{alias.name}" for alias in node.names)


def faults(path: str, source: str) -> list[str]:
    """What the module at that path (in the package) imports and should not."""
    parts = path.removesuffix(".py").split("/")
    module = ".".join([PACKAGE, *parts])
    own = room(module)
    found = []
    for name in imported(ast.parse(source), module):
        top = name.split(".")[0]
        if top == PACKAGE:
            other = room(name) if name != PACKAGE else "ground"
            if name.count(".") == 1 and not _is_module(name):
                other = "ground"  # a value that the package itself holds, such as __version__
            if other != own and FLOORS[other] >= FLOORS[own]:
                found.append(f"{path}: {own} (floor {FLOORS[own]}) imports {name}")
        elif top in CONFINED and not path.startswith(CONFINED[top]):
            found.append(f"{path}: imports {top}, confined to {', '.join(CONFINED[top])}")
        elif own == "ground" and top not in {"numpy", *sys.stdlib_module_names}:
            if (path, top) == ("compiled.py", "numba"):
                continue
            found.append(f"{path}: the ground floor imports {top}")
    return found


def _is_module(name: str) -> bool:
    part = name.split(".")[1]
    return (SOURCE / part).is_dir() or (SOURCE / f"{part}.py").is_file()


MODULES = sorted(p.relative_to(SOURCE).as_posix() for p in SOURCE.rglob("*.py"))


def test_every_room_has_a_floor() -> None:
    folders = {p.name for p in SOURCE.iterdir() if p.is_dir() and p.name != "__pycache__"}
    files = {p.stem for p in SOURCE.glob("*.py")} - {"__init__", "__main__"}
    assert folders == set(FLOORS) - {"ground"}
    assert files <= GROUND


@pytest.mark.parametrize("path", MODULES)
def test_imports_point_down(path: str) -> None:
    assert faults(path, (SOURCE / path).read_text(encoding="utf-8")) == []


@pytest.mark.parametrize(
    ("path", "source"),
    [
        ("optim/sppso.py", "from markerless_tracker.body import load_body"),
        ("camera/model.py", "from markerless_tracker import fitness"),
        ("fitness/views.py", "def f():\n    import markerless_tracker.datasets.markers.trc"),
        ("tracking/tracker.py", "from ..node.tracker import executable"),
        ("tracking/tracker.py", "import rclpy.node"),
        ("results/score.py", "from rosbags.rosbag2 import Writer"),
        ("datasets/video.py", "import rosbags"),
        ("records.py", "import scipy"),
        ("geometry.py", "from markerless_tracker.camera import CameraModel"),
        ("results/score.py", "from markerless_tracker.bags import write_bag"),
    ],
)
def test_a_fault_is_seen(path: str, source: str) -> None:
    assert len(faults(path, source)) == 1


@pytest.mark.parametrize(
    ("path", "source"),
    [
        ("cli/track.py", "from markerless_tracker.node.tracker import executable"),
        ("__main__.py", "from markerless_tracker.cli.main import main"),
        ("cli/main.py", "from markerless_tracker import __version__"),
        ("tracking/tracker.py", "from . import stages\nfrom .loss import lost"),
        ("fitness/views.py", "from ..camera.model import CameraRig\nimport numba"),
        ("datasets/bag/", "import rosbags.highlevel"),
        ("body/__init__.py", "from .markers import MARKER_NAMES"),
    ],
)
def test_what_may_be_imported(path: str, source: str) -> None:
    assert faults(path, source) == []
