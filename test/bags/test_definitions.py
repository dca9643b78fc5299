"""Definitions and type hashes in a bag are those that ROS 2 Jazzy itself installs."""

import json
import re
import sys
from pathlib import Path

import pytest
from mcap.reader import make_reader

from markerless_tracker.bags import write_bag
from markerless_tracker.datasets import open_recording

SHARE = Path(sys.prefix, "share")


def installed(kind: str, suffix: str) -> Path:
    package, _, name = kind.replace("/msg/", "/").partition("/")
    return SHARE / package / "msg" / f"{name}{suffix}"


def fields(text: str) -> list[str]:
    """Lines of a definition without comments and white space."""
    lines = (re.sub(r"\s+", " ", line.partition("#")[0]).strip() for line in text.splitlines())
    return [line for line in lines if line]


def test_definitions_and_hashes_are_those_of_ros(walk, tmp_path: Path) -> None:
    if not installed("sensor_msgs/msg/Image", ".msg").is_file():
        pytest.skip("ROS 2's message packages are not installed in this environment")
    compared = set()
    for number, compress in enumerate(("none", "jpeg")):
        write_bag(open_recording(walk), tmp_path / f"bag{number}", compress=compress)
        with (tmp_path / f"bag{number}" / f"bag{number}.mcap").open("rb") as file:
            summary = make_reader(file).get_summary()
        hashes = {summary.schemas[c.schema_id].name: c for c in summary.channels.values()}
        for schema in summary.schemas.values():
            assert schema.encoding == "ros2msg"
            first, *others = re.split(r"^=+\n", schema.data.decode(), flags=re.MULTILINE)
            parts = {schema.name: first}
            for other in others:
                head, _, body = other.partition("\n")
                parts[head.removeprefix("MSG: ")] = body
            for kind, text in parts.items():
                # tf2_msgs has no wheel.
                if installed(kind, ".msg").is_file():
                    own = installed(kind, ".msg").read_text(encoding="utf-8")
                    package = kind.partition("/")[0]
                    assert unqualified(fields(text), package) == unqualified(fields(own), package)
                    compared.add(kind.replace("/msg/", "/"))
            about = installed(schema.name, ".json")
            if about.is_file():
                known = json.loads(about.read_text(encoding="utf-8"))["type_hashes"]
                (stated,) = [h["hash_string"] for h in known if h["type_name"] == schema.name]
                assert hashes[schema.name].metadata["topic_type_hash"] == stated
    assert compared >= {
        "sensor_msgs/Image", "sensor_msgs/CompressedImage", "sensor_msgs/CameraInfo",
        "sensor_msgs/RegionOfInterest", "geometry_msgs/PoseArray", "geometry_msgs/Pose",
        "geometry_msgs/TransformStamped", "std_msgs/Header", "builtin_interfaces/Time",
    }  # fmt: skip


def unqualified(lines: list[str], package: str) -> list[str]:
    """Lines without the package of types of the same package."""
    return [re.sub(rf"^{package}/(msg/)?", "", line) for line in lines]
