"""Checks of this machine: shared memory, socket buffers, threads, ROS, the middleware's profile."""

import os
import shutil
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path

from markerless_tracker.checks.finding import GREEN, RED, YELLOW, Finding
from markerless_tracker.libraries import usable_cores

SEGMENT_MIB = 16
"""Shared memory that each process takes with the shipped profile."""
FREE_MIB = (4 * SEGMENT_MIB, 2 * SEGMENT_MIB)
"""Lower limits (yellow, red) of free shared memory. A player and a tracker need the second."""
SOCKET_BYTES = 2**21
"""Receive buffer below which images between machines get lost: two colour images of 656x490 px."""
LOAD = 0.75
"""Load per core above which a live tracker skips sets."""
MOST_DOMAIN = 232
"""Largest `ROS_DOMAIN_ID`: further domains have no ports."""
_ROS = (
    "rclpy",
    "sensor_msgs",
    "diagnostic_msgs",
    "geometry_msgs",
    "std_srvs",
    "visualization_msgs",
)
_THREADS = "NUMBA_NUM_THREADS"
_RMW = "rmw_fastrtps_cpp"
_MIB = 2**20


def check_machine(
    environment: Mapping[str, str],
    *,
    profiles: tuple[str, ...],
    shipped: Path,
    shared_memory: Path = Path("/dev/shm"),
    receive_buffer: Path = Path("/proc/sys/net/core/rmem_max"),
) -> list[Finding]:
    """All checks that need no running ROS graph.

    Args:
        environment: environment variables of this process.
        profiles: environment variables that may name a profile of Fast DDS.
        shipped: the package's profile.
        shared_memory: folder of the system's shared memory.
        receive_buffer: file with the largest size of a socket's buffer.
    """
    found = [
        _shared_memory(shared_memory),
        _sockets(receive_buffer),
        _threads(environment),
        _ros(),
        _profile(environment, profiles, shipped),
        _discovery(environment),
    ]
    return [finding for finding in found if finding is not None]


def _shared_memory(folder: Path) -> Finding:
    name = "shared memory"
    if not folder.is_dir():
        return Finding(
            name, YELLOW, "", f"{folder} does not exist",
            "images go through UDP on this machine; mount a tmpfs there",
        )  # fmt: skip
    usage = shutil.disk_usage(folder)
    free = usage.free / _MIB
    text = f"{free:.0f} of {usage.total / _MIB:.0f} MiB free in {folder}"
    if free >= FREE_MIB[0]:
        return Finding(name, GREEN, "", text)
    return Finding(
        name, YELLOW if free >= FREE_MIB[1] else RED, "",
        f"{text}; each process takes {SEGMENT_MIB} MiB",
        f"remove what ended processes left (rm {folder}/fastrtps_*), or give a container more "
        "(--shm-size=256m)",
    )  # fmt: skip


def _sockets(file: Path) -> Finding:
    name = "socket buffers"
    try:
        size = int(file.read_text())
    except (OSError, ValueError):
        return Finding(name, GREEN, "", f"{file} cannot be read: not checked")
    text = f"at most {size} bytes are received at once"
    if size >= SOCKET_BYTES:
        return Finding(name, GREEN, "", text)
    return Finding(
        name, YELLOW, "", f"{text}: images from other machines get lost",
        f"sudo sysctl -w net.core.rmem_max={8 * SOCKET_BYTES}, or a segmenter beside each camera; "
        "on one machine nothing need be done",
    )  # fmt: skip


def _threads(environment: Mapping[str, str]) -> Finding:
    cores = usable_cores()
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else 0.0
    text = f"{cores} cores may be used, load {load:.1f}"
    if limit := environment.get(_THREADS):
        text += f", {_THREADS}={limit}"
    if cores < 2:
        return Finding(
            "threads", YELLOW, "", text,
            "a tracker at 30 sets/s needs 2 cores: taskset, cgroup or container limit them",
        )  # fmt: skip
    if load > LOAD * cores:
        return Finding("threads", YELLOW, "", text, "end what else runs: a live tracker skips sets")
    return Finding("threads", GREEN, "", text)


def _ros() -> Finding:
    missing = [name for name in _ROS if find_spec(name) is None]
    if missing:
        return Finding(
            "ROS", RED, "", f"{', '.join(missing)} cannot be imported",
            "source a ROS 2 Jazzy setup (. /opt/ros/jazzy/setup.bash), or "
            "pip install 'markerless_tracker[ros]'; offline verbs need none",
        )  # fmt: skip
    if find_spec("tf2_msgs") is None:
        return Finding(
            "ROS", YELLOW, "", "found, without tf2_msgs: no TF is published",
            "source a ROS 2 installation for TF; `markers` shows the body without it",
        )  # fmt: skip
    return Finding("ROS", GREEN, "", "found, with TF")


def _profile(environment: Mapping[str, str], names: tuple[str, ...], shipped: Path) -> Finding:
    name, rmw = "profile", environment.get("RMW_IMPLEMENTATION") or _RMW
    if rmw != _RMW:
        return Finding(
            name, YELLOW, "", f"RMW_IMPLEMENTATION is {rmw}",
            f"the tests run on {_RMW}; see that {rmw} passes whole images between processes",
        )  # fmt: skip
    chosen = [(variable, environment[variable]) for variable in names if environment.get(variable)]
    if not chosen or Path(chosen[0][1]) == shipped:
        return Finding(name, GREEN, "", f"{shipped}, applied by the nodes")
    variable, path = chosen[0]
    try:
        tree = ElementTree.parse(path)
    except (OSError, ElementTree.ParseError) as error:
        return Finding(
            name, RED, "", f"{variable} names {path}, which cannot be used: {error}",
            f"correct it, or unset {variable}: the nodes then apply the shipped one",
        )  # fmt: skip
    sizes = [
        int(element.text or 0)
        for element in tree.iter()
        if element.tag.endswith("segment_size") and (element.text or "").strip().isdecimal()
    ]
    if sizes and max(sizes) >= SEGMENT_MIB * _MIB:
        return Finding(name, GREEN, "", f"{path}, by {variable}: {max(sizes) / _MIB:.0f} MiB")
    return Finding(
        name, YELLOW, "",
        f"{path}, by {variable}: no shared memory of {SEGMENT_MIB} MiB for images",
        f"take over the transports of {shipped}, or unset {variable}",
    )  # fmt: skip


def _discovery(environment: Mapping[str, str]) -> Finding:
    domain = environment.get("ROS_DOMAIN_ID") or "0"
    range_ = environment.get("ROS_AUTOMATIC_DISCOVERY_RANGE") or "SUBNET"
    if not domain.isascii() or not domain.isdecimal() or int(domain) > MOST_DOMAIN:
        return Finding(
            "discovery", RED, "", f"ROS_DOMAIN_ID is {domain!r}",
            f"set it to a whole number from 0 to {MOST_DOMAIN}",
        )  # fmt: skip
    text = f"domain {domain}, range {range_}"
    if range_ in ("LOCALHOST", "OFF") or environment.get("ROS_LOCALHOST_ONLY") == "1":
        return Finding("discovery", GREEN, "", f"{text}: this machine only")
    return Finding("discovery", GREEN, "", text)
