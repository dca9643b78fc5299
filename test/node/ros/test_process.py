import importlib
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from markerless_tracker.errors import ConfigError
from markerless_tracker.node.ros.process import Listener, StopSignals, run_executable

WITHOUT_ROS = """
import sys
class Missing:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in ("rclpy", "sensor_msgs", "std_srvs", "diagnostic_msgs",
                                  "geometry_msgs", "visualization_msgs", "std_msgs"):
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
sys.meta_path.insert(0, Missing())
from markerless_tracker.node.NODE.executable import main
sys.exit(main([]))
"""


SIGNALLED = """
import os, sys
from markerless_tracker.node.ros.process import run_executable
def body(argv, stop):
    for _ in range(3):
        exec("os.kill(os.getpid(), int(sys.argv[1]))")
    print("went on, asked:", stop.received)
    return 7
sys.exit(run_executable("x", body, []))
"""
ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture(autouse=True)
def _own_signals() -> Iterator[None]:
    """An executable ignores signals once it is through; the tests must not."""
    numbers = (signal.SIGINT, signal.SIGTERM)
    handlers = [signal.getsignal(number) for number in numbers]
    yield
    for number, handler in zip(numbers, handlers, strict=True):
        signal.signal(number, handler)


@pytest.mark.parametrize("node", ["tracker", "player"])
def test_without_ros_there_is_one_clear_line(node: str, project_root: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT_ROS.replace("NODE", node)],
        capture_output=True,
        text=True,
        timeout=120,
        env={**os.environ, "PYTHONPATH": str(project_root)},
    )
    assert done.returncode == 1 and done.stdout == ""
    (line,) = done.stderr.splitlines()
    assert "ROS 2 is not installed" in line and "markerless_tracker[ros]" in line


def test_errors_are_one_line_and_exit_1(capsys: pytest.CaptureFixture[str]) -> None:
    def fail(_: list[str], __: StopSignals) -> int:
        raise ConfigError("seed: got -1, expected at least 0")

    assert run_executable("tracker", fail, []) == 1
    assert capsys.readouterr().err == "tracker: seed: got -1, expected at least 0\n"


def test_a_path_without_permission_is_one_line_and_exit_1(
    capsys: pytest.CaptureFixture[str],
) -> None:
    def fail(_: list[str], __: StopSignals) -> int:
        raise PermissionError(13, "Permission denied", "/closed/walk.trc")

    assert run_executable("tracker", fail, []) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert line == "tracker: [Errno 13] Permission denied: '/closed/walk.trc'"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_is_noted_and_breaks_nothing(number: int) -> None:
    done = subprocess.run(
        [sys.executable, "-c", SIGNALLED, str(int(number))],
        capture_output=True,
        text=True,
        timeout=60,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )
    assert (done.returncode, done.stdout, done.stderr) == (7, "went on, asked: True\n", "")


@pytest.mark.parametrize(
    ("node", "parameters"),
    [
        (
            "tracker",
            (
                "calibration_file",
                "scale factor by which images are made smaller on arrival [1.0]",
                "tf_cameras publish the optical frames of `calibration_file` on /tf_static [true]",
                "sppso, hmcpso, hpso, mcpso, pso, glpso, apf, pf) [sppso]", "edge_weight",
                "evidence: none, every camera has a segmenter (auto, raw",
            ),
        ),
        ("player", ("bag", "loop start again at the end [false]")),
        ("segmenter", ("camera", "value_max of grey cameras (without `undecided`) [0.95]")),
    ],
)  # fmt: skip
def test_help_lists_the_parameters_with_their_defaults(
    node: str,
    parameters: tuple[str, ...],
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    pytest.importorskip("rclpy", reason="ROS 2 is not installed")
    monkeypatch.setenv("COLUMNS", "80")
    main = importlib.import_module(f"markerless_tracker.node.{node}.executable").main
    assert main(["--help"]) == 0
    text = capsys.readouterr().out
    assert "example:" in text
    assert [line for line in text.splitlines() if line[80:]] == []
    words = " ".join(text.split())
    assert [one for one in parameters if one not in words] == []


class Deaf(Listener):
    """Cannot subscribe."""

    def _subscribe_all(self) -> None:
        assert self._node.context.ok()
        raise ValueError("no such topic")


def test_a_listener_that_cannot_subscribe_leaves_no_node() -> None:
    pytest.importorskip("rclpy", reason="ROS 2 is not installed")
    listener = Deaf("deaf", domain_id=77)
    with pytest.raises(ValueError, match="no such topic"), listener:
        pass
    assert not listener._node.context.ok()


def test_the_tracker_touches_memory_for_the_first_images(project_root: Path) -> None:
    pytest.importorskip("rclpy", reason="ROS 2 is not installed")
    code = (
        "import markerless_tracker.libraries as libraries\n"
        "kept = []\n"
        "libraries.keep_freed_memory = lambda: kept.append(True)\n"
        "libraries.touch_memory = lambda size_bytes: exit(f'{kept} {size_bytes >> 20} MB')\n"
        "from markerless_tracker.node.tracker.executable import main\n"
        "main([])\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        timeout=120,
        env={**os.environ, "PYTHONPATH": str(project_root)},
    )
    assert done.stderr == "[True] 128 MB\n"
