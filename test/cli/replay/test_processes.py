"""Nodes as processes: parameters arrive as given, failures are summary, nothing is left running."""

from pathlib import Path

import pytest
import yaml

from markerless_tracker.cli.replay.processes import NodeError, NodeProcess, ros_arguments


@pytest.mark.parametrize(
    ("value", "arrives"),
    [
        (Path("/tmp/2026"), "/tmp/2026"),
        ("1e3", "1e3"),
        ("with space", "with space"),
        ("it's", "it's"),
        (True, True),
        (0.5, 0.5),
        (7, 7),
    ],
)
def test_parameters_arrive_as_given(value: object, arrives: object) -> None:
    flag, option, word = ros_arguments({"name": value})
    assert (flag, option) == ("--ros-args", "-p")
    name, _, text = word.partition(":=")
    # rcl reads the value as YAML.
    assert (name, yaml.safe_load(text)) == ("name", arrives)


def write_module(folder: Path, monkeypatch: pytest.MonkeyPatch, code: str) -> str:
    (folder / "made_up_node.py").write_text(code)
    monkeypatch.setenv("PYTHONPATH", str(folder))
    return "made_up_node"


def start(module: str, folder: Path) -> NodeProcess:
    return NodeProcess(module, {}, log=folder / "log" / "node.log", domain_id=5)


def test_a_failure_gives_the_last_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    module = write_module(tmp_path, monkeypatch, "import sys\nprint('a')\nsys.exit('no camera')")
    with start(module, tmp_path) as node:
        node.wait(120.0)
        with pytest.raises(NodeError, match="made_up ended with status 1: no camera"):
            node.check()


def test_its_warnings_are_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    log = "print('[INFO] [1.5] [player]: playing')\nprint('[WARN] [2.5] [player]: lens[1]: late')"
    with start(write_module(tmp_path, monkeypatch, log), tmp_path) as node:
        assert node.wait(120.0)
        assert node.warnings() == ["lens[1]: late"]


def test_a_process_ends_on_sigint(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    module = write_module(
        tmp_path,
        monkeypatch,
        # As nodes do: a job in the background inherits that SIGINT is ignored.
        "import os, signal, sys, time\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "try:\n"
        "    print('domain', os.environ['ROS_DOMAIN_ID'])\n"
        # A signal just before a sleep does not end it.
        "    while True:\n"
        "        time.sleep(0.05)\n"
        "except KeyboardInterrupt:\n"
        "    sys.exit(0)\n",
    )
    with start(module, tmp_path) as node:
        log = tmp_path / "log" / "node.log"
        while "domain 5" not in log.read_text():
            node.check()
        assert node.running
    assert not node.running
    assert node.stop() == 0


def test_a_process_that_ignores_sigint_is_killed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    module = write_module(
        tmp_path,
        monkeypatch,
        "import signal, time\n"
        "signal.signal(signal.SIGINT, signal.SIG_IGN)\n"
        "print('deaf')\n"
        "time.sleep(60)\n",
    )
    node = start(module, tmp_path)
    while "deaf" not in (tmp_path / "log" / "node.log").read_text():
        node.check()
    assert node.stop(timeout_s=0.2) == -9
