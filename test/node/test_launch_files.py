"""Launch files and presets name only what exists: executables, parameters, arguments, files."""

import re
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import Any

import pytest
import yaml

pytest.importorskip("rclpy", reason="ROS 2 is not installed")

from markerless_tracker.errors import ConfigError
from markerless_tracker.node.inputs.wire import settings_digest
from markerless_tracker.node.player.parameters import descriptions as player_parameters
from markerless_tracker.node.ros.declared import launched
from markerless_tracker.node.segmenter.parameters import (
    known_parameters,
    read_segmenter_settings,
)
from markerless_tracker.node.tracker.parameters import parameter_names, read_settings

ROOT = Path(__file__).resolve().parents[2]
LAUNCH = sorted((ROOT / "launch").glob("*.xml"))
PRESETS = ("sppso", "hmcpso", "paper")
KNOWN = {
    "tracker": set(parameter_names()),
    "player": set(player_parameters()),
    "segmenter": set(known_parameters()),
}
LAUNCHED = "launch."
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
        names = {
            str(param.get("name")).removeprefix(LAUNCHED)
            for param in node.findall("param")
            if param.get("name")
        }
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


def as_launched(path: Path, words: dict[str, str]) -> dict[str, Any]:
    """The tracker's parameters that a launch file gives after those of `params_file`."""
    declared, given = {**arguments(path), **words}, {}
    (node,) = (node for node in elements(path, "node") if node.get("exec") == "tracker")
    for param in node.findall("param"):
        found = re.fullmatch(r"\$\(var (\w+)\)", param.get("value", ""))
        if found:
            # As launch_ros does, which writes an empty text for an empty argument.
            given[str(param.get("name"))] = yaml.safe_load(declared[found[1]] or "''")
    return given


def test_an_argument_left_out_is_a_parameter_left_out() -> None:
    launch = as_launched(ROOT / "launch" / "tracker.launch.xml", {})
    assert read_settings(launched(launch)) == read_settings({})


def test_arguments_replace_what_the_file_of_parameters_says_and_no_more() -> None:
    file = {"stature": 1.9, "tf": "root", "image_transport": "compressed", "start_file": "a.trc"}
    launch = as_launched(
        ROOT / "launch" / "tracker.launch.xml", {"stature": "1.75", "calibration_file": "c.toml"}
    )
    expected = {**file, "stature": 1.75, "calibration_file": "c.toml"}
    assert read_settings(launched({**file, **launch})) == read_settings(expected)


def test_one_file_of_parameters_serves_both_nodes_of_the_split_graph() -> None:
    content = yaml.safe_load((ROOT / "config" / "two_machines.yaml").read_text())
    shared = content["/**"]["ros__parameters"]
    own = content["/**/tracker"]["ros__parameters"]
    assert set(content) == {"/**", "/**/tracker"}
    tracker = read_settings({**shared, **own})
    segmenter = read_segmenter_settings({**shared, "camera": "cam01", "background_dir": "empty"})
    assert tracker.takes_evidence("cam01") and tracker.scale == segmenter.scale
    assert settings_digest(tracker.config) == settings_digest(segmenter.config)


def test_the_policy_lets_each_node_do_what_it_does_and_no_more() -> None:
    """Topics by their names in the sources; the tracker hears no image."""
    enclaves = {}
    for enclave in ElementTree.parse(ROOT / "config/sros2/two_machines.xml").iter("enclave"):
        topics = {
            (mode, str(topic.text))
            for block in enclave.iter("topics")
            for mode in block.attrib
            for topic in block.iter("topic")
        }
        enclaves[str(enclave.get("path")).strip("/")] = topics
    names = [f"cam0{number}" for number in range(1, 5)]
    assert set(enclaves) == {"tracker", *(f"segmenter_{name}" for name in names)}
    sources = "".join(path.read_text() for path in (ROOT / "markerless_tracker/node").rglob("*.py"))
    of_ros = {"parameter_events", "rosout", "clock"}
    for enclave, topics in enclaves.items():
        images = {topic for mode, topic in topics if "image" in topic}
        if enclave == "tracker":
            assert images == set()
            assert {("subscribe", f"{name}/silhouette") for name in names} <= topics
        else:
            own = enclave.removeprefix("segmenter_")
            assert images == {f"{own}/image_raw", f"{own}/image_raw/compressed"}
            assert {("publish", f"{own}/silhouette"), ("publish", f"{own}/edges")} <= topics
        for _, topic in topics:
            last = topic.strip("/").rpartition("/")[2]
            assert last in of_ros or last in sources, topic


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
