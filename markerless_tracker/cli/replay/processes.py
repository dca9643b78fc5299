"""Nodes as child processes, which end together with this process."""

import os
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import IO

from markerless_tracker.errors import TrackerError


class NodeError(TrackerError):
    """A node ended early, or was not ready in time."""


class NodeProcess:
    """A running ROS executable of this package; a context manager that ends it.

    Args:
        module: the executable's module.
        parameters: its ROS parameters.
        log: file for its output.
        domain_id: its ROS domain.
    """

    def __init__(
        self, module: str, parameters: Mapping[str, object], *, log: Path, domain_id: int
    ) -> None:
        self.name = module.rsplit(".", 1)[-1].removesuffix("_node")
        self._log = log
        log.parent.mkdir(parents=True, exist_ok=True)
        self._sink: IO[bytes] = log.open("wb")
        self._process = subprocess.Popen(
            [sys.executable, "-m", module, *ros_arguments(parameters)],
            stdin=subprocess.DEVNULL,
            stdout=self._sink,
            stderr=subprocess.STDOUT,
            env=_environment(domain_id, log.parent),
        )

    def __enter__(self) -> "NodeProcess":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.stop()

    @property
    def running(self) -> bool:
        """Whether the process has not ended."""
        return self._process.poll() is None

    def wait(self, timeout_s: float) -> bool:
        """Wait until it ends; returns whether it has ended."""
        try:
            self._process.wait(timeout_s)
        except subprocess.TimeoutExpired:
            return False
        return True

    def check(self) -> None:
        """Check that it runs, or ended with status 0.

        Raises:
            NodeError: it failed; holds the last line of its output.
        """
        status = self._process.poll()
        if status:
            raise NodeError(f"{self.name} ended with status {status}: {self._last_line()}")

    def output(self) -> str:
        """Its output so far."""
        return self._log.read_text(encoding="utf-8", errors="replace")

    def warnings(self) -> list[str]:
        """The texts of the warnings in its log so far."""
        lines = self.output().splitlines()
        return [line.partition("]: ")[2] for line in lines if line.startswith("[WARN]")]

    def stop(self, timeout_s: float = 20.0) -> int:
        """End it with SIGINT, after the timeout with SIGKILL; returns its exit status."""
        if self.running:
            self._process.send_signal(signal.SIGINT)
        if not self.wait(timeout_s):
            self._process.kill()
        status = self._process.wait()
        self._sink.close()
        return status

    def _last_line(self) -> str:
        lines = self.output().split("\n")
        return next((line.strip() for line in reversed(lines) if line.strip()), "no output")


def ros_arguments(parameters: Mapping[str, object]) -> Sequence[str]:
    """Command-line words that give a node its parameters."""
    words = ["--ros-args"]
    for name, value in parameters.items():
        text = str(value)
        if isinstance(value, bool):
            text = text.lower()
        elif isinstance(value, (str, Path)):
            # Quoted, because ROS would parse a path such as 2026 or 1e3 as a number.
            text = "'" + text.replace("'", "''") + "'"
        words += ["-p", f"{name}:={text}"]
    return words


def _environment(domain_id: int, log_dir: Path) -> dict[str, str]:
    return {
        **os.environ,
        "ROS_DOMAIN_ID": str(domain_id),
        "ROS_LOG_DIR": str(log_dir / "ros"),
        "PYTHONUNBUFFERED": "1",
    }
