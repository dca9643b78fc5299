"""Launch files and presets name only what exists: executables, parameters, arguments, files."""

import re
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import Any

import pytest
import yaml

pytest.importorskip("rclpy", reason="ROS 2 is not installed")

from markerless_tracker.errors import ConfigError
from markerless_tracker.node.player.parameters import descriptions as player_parameters
from markerless_tracker.node.segmenter.parameters import (
    known_parameters,
    read_segmenter_settings,
)
from markerless_tracker.node.segmenter.wire import settings_digest
from markerless_tracker.node.tracker.parameters import parameter_names, read_settings

ROOT = Path(__file__).resolve().parents[2]
LAUNCH = sorted((ROOT / "launch").glob("*.xml"))
PRESETS = ("sppso", "hmcpso", "paper")
KNOWN = {
    "tracker": set(parameter_names()),
    "player": set(player_parameters()),
    "segmenter": set(known_parameters()),
}
SHARE = "$(find-pkg-share markerless_tracker)/"


def elements(path: Path, tag: str) -> list[ElementTree.Element]:
    return list(ElementTree.parse(path).getroot().iter(tag))


def arguments(path: Path) -> dict[str, str | None]:
    """Declared arguments and their defaults."""
    root = ElementTree.parse(path).getroot()
    return {str(arg.get("name")): arg.get("default") for arg in root.findall("arg")}


@pytest.mark.parametrize("path", LAUNCH, ids=lambda path: path.name)
def test_nodes_have_the_parameters_that_are_given(path: Path) -> None:
    nodes = elements(path, "node")
    ours = [node for node in nodes if node.get("pkg") == "markerless_tracker"]
    assert ours and {node.get("pkg") for node in nodes} <= {"markerless_tracker", "rviz2"}
    for node in ours:
        names = {param.get("name") for param in node.findall("param")} - {None}
        assert names and names <= KNOWN[str(node.get("exec"))]


@pytest.mark.parametrize("path", LAUNCH, ids=lambda path: path.name)
def test_arguments_and_files_exist(path: Path) -> None:
    declared, text = arguments(path), path.read_text()
    used = set(re.findall(r"\$\(var (\w+)\)", text))
    assert used == set(declared)
    for found in re.findall(re.escape(SHARE) + r"([^\"]+)", text):
        assert (ROOT / found).is_file(), found
    for include in elements(path, "include"):
        file = ROOT / str(include.get("file")).removeprefix(SHARE)
        given = {arg.get("name") for arg in include.findall("arg")}
        assert given <= set(arguments(file))
        required = {name for name, default in arguments(file).items() if default is None}
        assert required <= given


@pytest.mark.parametrize("path", LAUNCH, ids=lambda path: path.name)
def test_an_argument_left_out_is_a_parameter_left_out(path: Path) -> None:
    declared = arguments(path)
    for node in elements(path, "node"):
        if node.get("exec") != "tracker":
            continue
        given = {}
        for param in node.findall("param"):
            found = re.fullmatch(r"\$\(var (\w+)\)", param.get("value", ""))
            if found:
                given[str(param.get("name"))] = yaml.safe_load(declared[found[1]] or "''")
        assert read_settings(given) == read_settings({})


def test_one_file_of_parameters_serves_both_nodes_of_the_split_graph() -> None:
    content = yaml.safe_load((ROOT / "config" / "two_machines.yaml").read_text())
    shared = content["/**"]["ros__parameters"]
    own = content["/**/tracker"]["ros__parameters"]
    assert set(content) == {"/**", "/**/tracker"}
    tracker = read_settings({**shared, **own})
    segmenter = read_segmenter_settings({**shared, "camera": "cam01", "background_dir": "empty"})
    assert tracker.takes_evidence("cam01") and tracker.scale == segmenter.scale
    assert settings_digest(tracker.config) == settings_digest(segmenter.config)


def preset(name: str) -> dict[str, Any]:
    content = yaml.safe_load((ROOT / "config" / f"{name}.yaml").read_text())
    return dict(content["/**"]["ros__parameters"])


@pytest.mark.parametrize("name", PRESETS)
def test_presets_are_parameters_of_the_tracker(name: str) -> None:
    settings = read_settings(preset(name)).config
    assert settings.optimizer == ("hmcpso" if name == "hmcpso" else "sppso")
    assert settings.preset == ("paper" if name == "paper" else "tuned")
    assert settings.refinement == ("none" if name == "paper" else "contour")
    with pytest.raises(ConfigError, match="unknown"):
        read_settings({**preset(name), "evalutions": 3})
