"""The package as colcon and pip install it: version, files, entry points."""

import ast
import re
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
import zipfile
from pathlib import Path

import pytest
import yaml

from markerless_tracker import __version__

NAME = "markerless_tracker"
EXECUTABLES = {
    "markerless_tracker": "markerless_tracker.cli.main:main",
    "player": "markerless_tracker.node.player.executable:main",
    "segmenter": "markerless_tracker.node.segmenter.executable:main",
    "tracker": "markerless_tracker.node.tracker.executable:main",
}


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> zipfile.ZipFile:
    """The wheel that pip builds from a copy of the source tree, offline."""
    pytest.importorskip("setuptools", minversion="70.1", reason="needed to build the wheel")
    root = Path(__file__).resolve().parent.parent
    work = tmp_path_factory.mktemp("wheel")
    for item in (NAME, "config", "launch", "resource"):
        shutil.copytree(root / item, work / item, ignore=shutil.ignore_patterns("__pycache__"))
    for item in ("setup.py", "setup.cfg", "pyproject.toml", "package.xml", "LICENSE"):
        shutil.copy(root / item, work)
    done = subprocess.run(
        [sys.executable, "-m", "pip", "wheel", "--no-deps", "--no-build-isolation", "--no-index"]
        + ["--quiet", "--disable-pip-version-check", "--wheel-dir", str(work / "out"), str(work)],
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    (built,) = (work / "out").glob("*.whl")
    return zipfile.ZipFile(built)


def package_xml(root: Path) -> ElementTree.Element:
    return ElementTree.parse(root / "package.xml").getroot()


def test_the_version_is_the_same_everywhere(project_root: Path) -> None:
    assert package_xml(project_root).findtext("version") == __version__
    changelog = (project_root / "CHANGELOG.md").read_text(encoding="utf-8")
    assert re.search(rf"^## \[{re.escape(__version__)}\]", changelog, re.MULTILINE)
    citation = yaml.safe_load((project_root / "CITATION.cff").read_text(encoding="utf-8"))
    assert citation["version"] == __version__ and citation["license"] == "Apache-2.0"
    assert {"cff-version", "message", "title", "authors"} <= set(citation)


def test_manifest(project_root: Path) -> None:
    root = package_xml(project_root)
    assert root.get("format") == "3"
    assert root.findtext("name") == NAME
    assert root.findtext("license") == "Apache-2.0"
    assert root.findtext("export/build_type") == "ament_python"
    assert (project_root / "resource" / NAME).is_file()
    assert {url.get("type") for url in root.findall("url")} == {
        "website", "repository", "bugtracker"
    }  # fmt: skip
    for tag in ("description", "maintainer", "author"):
        assert root.findtext(tag), tag
    licence = (project_root / "LICENSE").read_text(encoding="utf-8")
    assert "Apache License" in licence
    assert "END OF TERMS AND CONDITIONS" in licence


def test_the_manifest_names_the_packages_of_the_launch_files(project_root: Path) -> None:
    launched = {
        node.get("pkg")
        for file in (project_root / "launch").glob("*.launch.xml")
        for node in ElementTree.parse(file).iter("node")
    }
    needed = {depend.text for depend in package_xml(project_root).iter("exec_depend")}
    assert "rviz2" in launched and launched <= {NAME, *needed}


def test_executables_are_in_the_folder_of_ros(project_root: Path) -> None:
    text = (project_root / "setup.cfg").read_text(encoding="utf-8")
    assert f"script_dir=$base/lib/{NAME}" in text
    assert f"install_scripts=$base/lib/{NAME}" in text


@pytest.mark.parametrize(("executable", "target"), EXECUTABLES.items())
def test_entry_points_exist(project_root: Path, executable: str, target: str) -> None:
    module, function = target.split(":")
    path = project_root.joinpath(*module.split(".")).with_suffix(".py")
    tree = ast.parse(path.read_text(encoding="utf-8"))
    assert function in {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}


def test_wheel_holds_every_module(wheel: zipfile.ZipFile, project_root: Path) -> None:
    sources = {p.relative_to(project_root).as_posix() for p in (project_root / NAME).rglob("*.py")}
    assert sources <= set(wheel.namelist())


def test_wheel_states_that_it_has_types(wheel: zipfile.ZipFile) -> None:
    assert f"{NAME}/py.typed" in wheel.namelist()


def test_wheel_holds_config_and_manifest(wheel: zipfile.ZipFile, project_root: Path) -> None:
    data = f"{NAME}-{__version__}.data/data/share"
    config = {
        f"{data}/{NAME}/{p.relative_to(project_root).as_posix()}"
        for folder in ("config", "launch")
        for p in (project_root / folder).rglob("*")
        if p.is_file()
    }
    index = f"{data}/ament_index/resource_index/packages/{NAME}"
    assert {*config, index, f"{data}/{NAME}/package.xml"} <= set(wheel.namelist())


def test_wheel_has_the_executables(wheel: zipfile.ZipFile) -> None:
    text = wheel.read(f"{NAME}-{__version__}.dist-info/entry_points.txt").decode()
    found = dict(re.findall(r"^(\w+) = (\S+)$", text, re.MULTILINE))
    assert found == EXECUTABLES


def test_ros_is_an_extra_only(wheel: zipfile.ZipFile) -> None:
    text = wheel.read(f"{NAME}-{__version__}.dist-info/METADATA").decode()
    required = re.findall(r"^Requires-Dist: (.+)$", text, re.MULTILINE)
    assert any(line.startswith("numpy") for line in required)
    ros = [line for line in required if line.startswith("ros-")]
    assert len(ros) == 2
    assert all('extra == "ros"' in line.replace("'", '"') for line in ros)


def test_all_is_every_extra_of_users_but_ros(wheel: zipfile.ZipFile) -> None:
    text = wheel.read(f"{NAME}-{__version__}.dist-info/METADATA").decode().replace("'", '"')
    found = re.findall(r'^Requires-Dist: ([\w-]+).*extra == "(\w+)"', text, re.MULTILINE)
    wanted = {name for name, extra in found if extra in {"cluster", "formats", "plots", "view"}}
    assert len(wanted) >= 6 and {name for name, extra in found if extra == "all"} == wanted


def test_lock_pins_every_direct_dependency(project_root: Path) -> None:
    lock = (project_root / "requirements" / "lock.txt").read_text(encoding="utf-8")
    pinned = {
        re.sub(r"[-_.]+", "-", line.split("==")[0]).lower()
        for line in lock.splitlines()
        if "==" in line
    }
    direct = (project_root / "requirements" / "direct.txt").read_text(encoding="utf-8")
    names = re.findall(r"^([A-Za-z][\w.-]*)", direct, re.MULTILINE)
    assert len(names) > 10
    assert {re.sub(r"[-_.]+", "-", name).lower() for name in names} <= pinned
    assert all(
        re.match(r"^[\w.-]+==\S+( ; .+)?$", line)
        for line in lock.splitlines()
        if line and not line.startswith("#")
    )
