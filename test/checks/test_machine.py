"""Checks of the machine: what is too little is red, and says what to do."""

from collections import namedtuple
from pathlib import Path
from typing import Any

import pytest

from markerless_tracker.checks import machine
from markerless_tracker.checks.machine import check_machine

VARIABLES = ("FASTRTPS_DEFAULT_PROFILES_FILE",)
Usage = namedtuple("Usage", "total used free")


def found(
    tmp_path: Path, environment: dict[str, str] | None = None, **named: Any
) -> dict[str, Any]:
    buffer = tmp_path / "rmem_max"
    if not buffer.exists():
        buffer.write_text("8388608\n")
    findings = check_machine(
        environment or {}, profiles=VARIABLES, shipped=Path("images.xml"),
        receive_buffer=buffer, **{"shared_memory": tmp_path, **named},
    )  # fmt: skip
    return {finding.check: finding for finding in findings}


def test_every_line_that_is_not_green_says_what_to_do(tmp_path: Path) -> None:
    lines = found(tmp_path)
    assert list(lines) == [
        "shared memory", "socket buffers", "threads", "ROS", "profile", "discovery"
    ]  # fmt: skip
    assert all(line.state == "green" or line.advice for line in lines.values())
    assert lines["socket buffers"].state == lines["profile"].state == "green"


@pytest.mark.parametrize("free, state", [(100, "green"), (40, "yellow"), (10, "red")])
def test_shared_memory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, free: int, state: str
) -> None:
    usage = Usage(256 * 2**20, 0, free * 2**20)
    monkeypatch.setattr(machine.shutil, "disk_usage", lambda _: usage)
    line = found(tmp_path)["shared memory"]
    assert line.state == state and f"{free} of 256 MiB" in line.text
    assert state == "green" or "fastrtps_" in line.advice
    assert found(tmp_path, shared_memory=tmp_path / "none")["shared memory"].state == "yellow"


@pytest.mark.parametrize(
    ("domain", "state"),
    [("", "green"), ("0", "green"), ("232", "green"), ("233", "red"), ("-1", "red"), ("a", "red")],
)
def test_domains(tmp_path: Path, domain: str, state: str) -> None:
    line = found(tmp_path, {"ROS_DOMAIN_ID": domain})["discovery"]
    assert line.state == state and (state == "green" or "0 to 232" in line.advice)


def test_small_socket_buffers(tmp_path: Path) -> None:
    (tmp_path / "rmem_max").write_text("212992\n")
    line = found(tmp_path)["socket buffers"]
    assert line.state == "yellow" and "sysctl" in line.advice


def test_without_ros(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(machine, "find_spec", lambda name: None if name == "rclpy" else name)
    line = found(tmp_path)["ROS"]
    assert line.state == "red" and "rclpy" in line.text and "[ros]" in line.advice


def test_profiles(tmp_path: Path) -> None:
    def line(path: str, **more: str) -> Any:
        return found(tmp_path, {VARIABLES[0]: path, **more})["profile"]

    assert line("images.xml").state == "green"
    assert line(str(tmp_path / "none.xml")).state == "red"
    own = tmp_path / "own.xml"
    own.write_text("<dds>")
    assert line(str(own)).state == "red"
    own.write_text("<dds><x xmlns='y'><segment_size>33554432</segment_size></x></dds>")
    assert line(str(own)).state == "green" and "32 MiB" in line(str(own)).text
    own.write_text("<dds><segment_size>524288</segment_size></dds>")
    assert line(str(own)).state == "yellow" and "unset" in line(str(own)).advice
    assert line("images.xml", RMW_IMPLEMENTATION="rmw_cyclonedds_cpp").state == "yellow"


def test_cores(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(machine.os, "getloadavg", lambda: (0.1, 0.1, 0.1))
    monkeypatch.setattr(machine, "usable_cores", lambda: 1)
    assert found(tmp_path)["threads"].state == "yellow"
    monkeypatch.setattr(machine, "usable_cores", lambda: 4)
    assert found(tmp_path, {"NUMBA_NUM_THREADS": "1"})["threads"].text.endswith(
        "NUMBA_NUM_THREADS=1"
    )
    monkeypatch.setattr(machine.os, "getloadavg", lambda: (3.5, 0.1, 0.1))
    assert found(tmp_path)["threads"].state == "yellow"
