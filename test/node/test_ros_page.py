"""docs/ros.md names parameters, keys, arguments, services and files that exist."""

import re
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="ROS 2 is not installed")

from markerless_tracker.datasets.bag.encodings import ENCODINGS
from markerless_tracker.node.inputs.wire import EDGES_TOPIC, FORMAT, SILHOUETTE_TOPIC
from markerless_tracker.node.player.parameters import descriptions as player_parameters
from markerless_tracker.node.segmenter.parameters import known_parameters
from markerless_tracker.node.tracker.cameras.counts import CameraCounter
from markerless_tracker.node.tracker.changes import LIVE
from markerless_tracker.node.tracker.parameters import parameter_names
from markerless_tracker.node.tracker.status import TrackerStatus
from markerless_tracker.node.tracker.synchronizer import SyncCounts

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "ros.md").read_text(encoding="utf-8")
SPLIT = (ROOT / "docs" / "two-machines.md").read_text(encoding="utf-8")


def section(title: str) -> str:
    return PAGE.partition(f"\n## {title}\n")[2].partition("\n## ")[0]


def test_every_value_is_given_to_a_parameter_or_an_argument() -> None:
    launch = "".join(path.read_text() for path in (ROOT / "launch").glob("*.xml"))
    arguments = set(re.findall(r'<arg name="(\w+)" (?:default|description)', launch))
    known = {*parameter_names(), *player_parameters(), *arguments, "in_transport", "out_transport"}
    given = set(re.findall(r"(?<![\w./])([a-z_]+):=", PAGE))
    assert len(given) > 12 and given - known <= {"in", "robot_description"}


def test_the_page_about_two_machines_names_what_exists() -> None:
    launch = "".join(path.read_text() for path in (ROOT / "launch").glob("*.xml"))
    arguments = set(re.findall(r'<arg name="(\w+)" (?:default|description)', launch))
    given = set(re.findall(r"(?<![\w./])([a-z_]+):=", SPLIT))
    assert {"camera", "background_dir", "image_transport", "evidence_cameras"} <= given
    assert given <= {*parameter_names(), *known_parameters(), *arguments, "__node"}
    for link in re.findall(r"\]\(([\w./-]+?)(?:#\w+)?\)", SPLIT):
        assert (ROOT / "docs" / link).is_file(), link
    for test in re.findall(r"`(test/[\w/]+\.py)`", SPLIT):
        assert (ROOT / test).is_file(), test
    assert FORMAT in SPLIT and SILHOUETTE_TOPIC in SPLIT and EDGES_TOPIC in SPLIT


def test_what_may_change_is_what_the_node_lets_change() -> None:
    text = section("While it runs")
    named = set(re.findall(r"`([a-z_]+)`", text.partition("```")[0]))
    assert named == {name.partition(".")[0] for name in LIVE}
    for name in re.findall(r"ros2 param (?:set|describe) /tracker ([\w.]+)", text):
        assert name in LIVE
    source = (ROOT / "markerless_tracker/node/tracker/services.py").read_text()
    for name in re.findall(r"ros2 service call /tracker/(\w+)", text):
        assert f'"~/{name}"' in source


def test_the_keys_are_those_of_state() -> None:
    views = CameraCounter(("NAME",)).counts()
    values = TrackerStatus().values(SyncCounts(), ("NAME",), (), views=views)
    keys = re.findall(r"\| `(\w+/NAME)` \|", section("State"))
    assert len(keys) == 7 and set(keys) <= set(values)


def test_the_encodings_are_all_that_are_known() -> None:
    text = section("Images").partition("Encodings of raw images: ")[2].partition(".")[0]
    assert set(re.findall(r"`(\w+)`", text)) == set(ENCODINGS)


def test_files_exist() -> None:
    files = re.findall(r"`((?:launch|config)/[\w.]+)`", PAGE)
    assert len(files) >= 6
    names = [*files, *(f"config/{name}" for name in ("hmcpso.yaml", "paper.yaml"))]
    assert [name for name in names if not (ROOT / name).is_file()] == []
    for link in re.findall(r"\]\(([\w./-]+?)(?:#\w+)?\)", PAGE):
        assert (ROOT / "docs" / link).is_file(), link
