"""The rooms: imports point down, rooms on one floor do not import each other, files stay small."""

import ast
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

PACKAGE = "markerless_tracker"
ROOT = Path(__file__).resolve().parent.parent
SOURCE = ROOT / PACKAGE

ROOMS = """
6  cli
5  node  benchmarks  viewing  bags  checks
4  results  calibration
3  tracking
2  fitness  datasets  synthesis  drawing
1  camera  body  imaging  optim
0  compiled  errors  geometry  libraries  observation  records  resources  settings
"""
"""The picture of CONTRIBUTING.md: floors and their rooms; modules of one file on the ground."""

FLOORS = {
    name: int(line.split()[0]) for line in ROOMS.strip().splitlines() for name in line.split()[1:]
}
GROUND = {name for name, floor in FLOORS.items() if floor == 0}
PUBLIC = "__init__"
"""The package itself: its public names come from any room; rooms use only its version."""

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
"""Libraries that only some folders may import."""

MOST_LINES = 350
MOST_FILES = 14
"""Files in a folder beside its `__init__.py`."""


def room(module: str) -> str:
    """Room of a dotted module name of the package."""
    part = module.split(".")[1] if "." in module else PUBLIC
    return "ground" if part in GROUND else "cli" if part == "__main__" else part


def floor(name: str) -> int:
    """Floor of a room."""
    return 0 if name == "ground" else 7 if name == PUBLIC else FLOORS[name]


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
            if base == PACKAGE:
                # "from markerless_tracker import camera" names a room in its aliases.
                yield from (f"{base}.{alias.name}" for alias in node.names)
            else:
                yield base


def faults(path: str, source: str) -> list[str]:
    """Forbidden imports of the module at that path in the package, one line each."""
    parts = path.removesuffix(".py").split("/")
    module = ".".join([PACKAGE, *parts])
    own = room(module)
    found = []
    for name in imported(ast.parse(source), module):
        top = name.split(".")[0]
        if top == PACKAGE:
            other = room(name)
            if name == PACKAGE or name == f"{PACKAGE}.__version__":
                continue
            if other not in {*FLOORS, "ground"}:
                other = PUBLIC  # a public name of the package
            if other != own and floor(other) >= floor(own):
                found.append(f"{path}: {own} (floor {floor(own)}) imports {name}")
        elif top in CONFINED and not path.startswith(CONFINED[top]):
            found.append(f"{path}: imports {top}, confined to {', '.join(CONFINED[top])}")
        elif own == "ground" and top not in {"numpy", *sys.stdlib_module_names}:
            if (path, top) == ("compiled.py", "numba"):
                continue
            found.append(f"{path}: the ground floor imports {top}")
    return found


def beside(module: str, name: str) -> tuple[str, str]:
    """Where two dotted names part: the two folders, or modules, beside each other."""
    ours, theirs = module.split("."), name.split(".")
    depth = 0
    while depth < min(len(ours), len(theirs)) and ours[depth] == theirs[depth]:
        depth += 1
    return ".".join(ours[: depth + 1]), ".".join(theirs[: depth + 1])


MODULES = sorted(p.relative_to(SOURCE).as_posix() for p in SOURCE.rglob("*.py"))
FILES = sorted(
    p.relative_to(ROOT).as_posix()
    for folder in (PACKAGE, "test", "bench", "examples")
    for p in (ROOT / folder).rglob("*.py")
)
FOLDERS = sorted({Path(file).parent.as_posix() for file in FILES})


def test_every_room_has_a_floor() -> None:
    folders = {p.name for p in SOURCE.iterdir() if p.is_dir() and p.name != "__pycache__"}
    files = {p.stem for p in SOURCE.glob("*.py")} - {"__init__", "__main__"}
    assert folders == set(FLOORS) - GROUND
    assert files == GROUND


def test_contributing_shows_the_rooms() -> None:
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    picture = text.split("```")[3]
    shown: dict[str, int] = {}
    number = None
    for line in picture.strip().splitlines():
        head, rest = line[:3].strip(), line[3:]
        number = int(head) if head else number
        assert number is not None
        names, _, description = rest.strip().partition("  ")
        assert description.strip(), f"{line!r} says nothing about its room"
        shown.update({name.strip(" /,"): number for name in names.split()})
    assert shown == FLOORS


@pytest.mark.parametrize("path", MODULES)
def test_imports_point_down(path: str) -> None:
    assert faults(path, (SOURCE / path).read_text(encoding="utf-8")) == []


@pytest.mark.parametrize("file", FILES)
def test_no_file_is_long(file: str) -> None:
    lines = len((ROOT / file).read_text(encoding="utf-8").splitlines())
    assert lines <= MOST_LINES, f"{file} has {lines} lines, expected at most {MOST_LINES}"


@pytest.mark.parametrize("folder", FOLDERS)
def test_no_folder_is_crowded(folder: str) -> None:
    names = [p.name for p in (ROOT / folder).glob("*.py") if p.name != "__init__.py"]
    assert len(names) <= MOST_FILES, f"{folder} has {len(names)} files, at most {MOST_FILES}"


def test_no_two_folders_import_each_other() -> None:
    edges: dict[tuple[str, str], str] = {}
    for path in MODULES:
        module = ".".join([PACKAGE, *path.removesuffix(".py").split("/")])
        source = (SOURCE / path).read_text(encoding="utf-8")
        for name in imported(ast.parse(source), module):
            pair = beside(module, name)
            if all((ROOT / part.replace(".", "/")).is_dir() for part in pair):
                edges[pair] = f"{module} imports {name}"
    assert len(edges) > 100
    mutual = [
        f"{text}; {edges[other, one]}"
        for (one, other), text in edges.items()
        if one < other and (other, one) in edges
    ]
    assert mutual == []


def test_no_module_is_a_drawer() -> None:
    drawers = {"utils", "util", "common", "helpers", "misc"}
    assert [file for file in FILES if drawers & {*Path(file).with_suffix("").parts}] == []


@pytest.mark.parametrize(
    ("path", "source"),
    [
        ("optim/sppso.py", "from markerless_tracker.body import load_body"),
        ("camera/model.py", "from markerless_tracker import fitness"),
        ("fitness/views.py", "def f():\n    import markerless_tracker.datasets.markers.trc"),
        ("tracking/tracker.py", "from ..node.tracker import executable"),
        ("tracking/tracker.py", "import rclpy.node"),
        ("tracking/tracker.py", "from markerless_tracker import TrackResult"),
        ("results/score.py", "from rosbags.rosbag2 import Writer"),
        ("results/score.py", "from markerless_tracker.benchmarks import machine"),
        ("benchmarks/jitter.py", "from markerless_tracker.viewing import debug_images"),
        ("datasets/video.py", "import rosbags"),
        ("records.py", "import scipy"),
        ("geometry.py", "from markerless_tracker.camera import CameraModel"),
        ("results/score.py", "from markerless_tracker.bags import write_bag"),
    ],
)
def test_a_forbidden_import_is_found(path: str, source: str) -> None:
    assert len(faults(path, source)) == 1


@pytest.mark.parametrize(
    ("path", "source"),
    [
        ("cli/track.py", "from markerless_tracker.node.tracker import executable"),
        ("__main__.py", "from markerless_tracker.cli.main import main"),
        ("__init__.py", "from markerless_tracker.tracking import Tracker"),
        ("cli/main.py", "from markerless_tracker import __version__"),
        ("results/result.py", "from markerless_tracker import __version__"),
        ("benchmarks/jitter.py", "from markerless_tracker.results.score import score"),
        ("tracking/tracker.py", "from . import stages\nfrom .loss import lost"),
        ("fitness/views.py", "from ..camera.model import CameraRig\nimport numba"),
        ("datasets/bag/", "import rosbags.highlevel"),
        ("body/__init__.py", "from .markers import MARKER_NAMES"),
    ],
)
def test_an_allowed_import_is_accepted(path: str, source: str) -> None:
    assert faults(path, source) == []
