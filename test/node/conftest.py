"""A ROS graph of its own for every test process, and a node in it."""

import ctypes
import importlib.util
import os
import shutil
import signal
import subprocess
import sys
import sysconfig
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

# rclpy reads these when it is imported or initialised.
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
os.environ["ROS_PYTHON_CHECK_FIELDS"] = "1"

ROOT = Path(__file__).resolve().parents[2]
DEADLINE_S = 120.0
"""Discovery takes up to 3 s, far more on a busy machine."""


def _domain() -> int:
    """One domain (1..101) per xdist worker, and another one in a test run beside this one."""
    worker = os.environ.get("PYTEST_XDIST_WORKER", "gw0")
    run = os.getppid() if "PYTEST_XDIST_WORKER" in os.environ else os.getpid()
    return (run * 8 + int(worker.removeprefix("gw"))) % 101 + 1


os.environ["ROS_DOMAIN_ID"] = str(_domain())


@pytest.fixture(scope="session", autouse=True)
def _ros_environment(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    from markerless_tracker.node.ros.profile import apply_profile

    old = dict(os.environ)
    os.environ["ROS_LOG_DIR"] = str(tmp_path_factory.mktemp("ros_log"))
    apply_profile()
    yield
    os.environ.clear()
    os.environ.update(old)


class Peer:
    """A node of the test's own, which can wait for conditions."""

    def __init__(self, context: Any) -> None:
        from rclpy.executors import SingleThreadedExecutor
        from rclpy.node import Node

        self.context = context
        self.node = Node("peer", context=context)
        self.executor = SingleThreadedExecutor(context=context)
        self.executor.add_node(self.node)

    def until(
        self,
        condition: Callable[[], Any],
        what: str | Callable[[], str],
        *,
        deadline_s: float = DEADLINE_S,
    ) -> Any:
        """Spin until the condition holds; fails, saying what was missing, if it never does.

        `what` may be made when it fails: what is known by then.
        """
        end_s = time.monotonic() + deadline_s
        while not (value := condition()):
            if time.monotonic() >= end_s:
                pytest.fail(f"timed out waiting for {what() if callable(what) else what}")
            self.executor.spin_once(timeout_sec=0.05)
        return value

    def collect(self, kind: type, topic: str, qos: Any) -> list[Any]:
        """A list that fills with the messages of a topic."""
        got: list[Any] = []
        self.node.create_subscription(kind, topic, got.append, qos)
        return got

    def close(self) -> None:
        self.executor.shutdown()
        self.node.destroy_node()


@pytest.fixture
def other_domain(monkeypatch: pytest.MonkeyPatch) -> None:
    """A domain apart from that of nodes which outlive a test; name it before other fixtures."""
    monkeypatch.setenv("ROS_DOMAIN_ID", str((int(os.environ["ROS_DOMAIN_ID"]) + 49) % 101 + 1))


@pytest.fixture
def ros_context() -> Iterator[Any]:
    rclpy = pytest.importorskip("rclpy", reason="ROS 2 is not installed")
    context = rclpy.Context()
    rclpy.init(context=context, args=[])
    yield context
    context.try_shutdown()


@pytest.fixture
def peer(ros_context: Any) -> Iterator[Peer]:
    peer = Peer(ros_context)
    yield peer
    peer.close()


@pytest.fixture
def run_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


class Process:
    """An executable of this package as a process of its own."""

    def __init__(
        self,
        node: str,
        log: Path,
        parameters: dict[str, Any],
        environment: dict[str, str] | None = None,
    ) -> None:
        arguments = ["--ros-args"]
        for name, value in parameters.items():
            text = str(value).lower() if isinstance(value, bool) else str(value)
            arguments += ["-p", f"{name}:={text}"]
        self.log = log
        with log.open("wb") as sink:
            self._popen = subprocess.Popen(
                [sys.executable, "-m", f"markerless_tracker.node.{node}.executable", *arguments],
                stdin=subprocess.DEVNULL,
                stdout=sink,
                stderr=subprocess.STDOUT,
                env={**os.environ, "PYTHONPATH": str(ROOT), **(environment or {})},
            )

    @property
    def pid(self) -> int:
        return self._popen.pid

    def shared_memory(self) -> set[Path]:
        """Its files in /dev/shm that no other process uses; ports belong to the domain."""
        lines = Path(f"/proc/{self.pid}/maps").read_text().splitlines()
        paths = {Path(line.split()[5]) for line in lines if "/dev/shm/fastrtps" in line}
        return {path for path in paths if "port" not in path.name}

    @property
    def running(self) -> bool:
        return self._popen.poll() is None

    @property
    def output(self) -> str:
        return self.log.read_text(errors="replace")

    def wait(self, timeout_s: float = 120.0) -> int:
        return self._popen.wait(timeout_s)

    def signal(self, number: int) -> None:
        self._popen.send_signal(number)

    def stop(self) -> None:
        if self.running:
            self._popen.send_signal(signal.SIGINT)
            try:
                self._popen.wait(60)
            except subprocess.TimeoutExpired:
                self._popen.kill()
                self._popen.wait()


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Callable[..., Process]]:
    started: list[Process] = []

    def begin(node: str, *, environment: Any = None, **parameters: Any) -> Process:
        pytest.importorskip("rclpy", reason="ROS 2 is not installed")
        log = tmp_path / f"{node}{len(started)}.log"
        process = Process(node, log, parameters, environment)
        started.append(process)
        return process

    yield begin
    for process in started:
        process.stop()


@pytest.fixture(scope="session")
def tf2_msgs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Makes tf2_msgs importable; the environment in which it is for other processes.

    Pip has no wheel of it: it is built from its definition with the generators' wheels.
    """
    if importlib.util.find_spec("tf2_msgs") is not None:
        return {}
    header = Path(sysconfig.get_path("include")) / "Python.h"
    for need, found in (("gcc", shutil.which("gcc")), ("g++", shutil.which("g++")),
                        ("Python.h", header.is_file())):  # fmt: skip
        if not found:
            pytest.skip(f"tf2_msgs is not installed, and building it needs {need}")
    folder = tmp_path_factory.mktemp("tf2_msgs") / "built"
    builder = Path(__file__).with_name("build_tf2_msgs.py")
    subprocess.run([sys.executable, str(builder), str(folder)], check=True, capture_output=True)
    for library in sorted((folder / "lib").glob("*.so")):
        ctypes.CDLL(str(library))  # LD_LIBRARY_PATH is read when a process starts
    libraries = f"{folder / 'lib'}{os.pathsep}{os.environ.get('LD_LIBRARY_PATH', '')}"
    sys.path.append(str(folder))
    return {"PYTHONPATH": f"{ROOT}{os.pathsep}{folder}", "LD_LIBRARY_PATH": libraries}


@pytest.fixture(scope="session")
def tools() -> Any:
    """The classes above, for fixtures that live longer than a test."""
    return SimpleNamespace(Peer=Peer, Process=Process)
