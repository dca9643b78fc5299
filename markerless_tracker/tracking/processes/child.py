"""A child process, and the memory that it shares with this one."""

import mmap
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple, cast

from markerless_tracker.tracking.processes.wire import receive, send

_PACKAGE = Path(__file__).resolve().parents[3]
_PIPE_BYTES = 1 << 20
"""Size of a pipe: it holds a result, so that the sender need not wait; Linux only."""
_AS_USUAL = -1


class SharedMemory(NamedTuple):
    """Memory shared by several processes.

    Attributes:
        fd: descriptor of its file.
        memory: its mapping in this process.
    """

    fd: int
    memory: mmap.mmap


class Child:
    """A process that runs a module of the package, with shared memory; it ends with this process.

    Args:
        module: its main program. Its arguments are `arguments` and the memory's descriptor.
        memory: size of the shared memory to make, in bytes, or memory that is shared already.
        arguments: further arguments of its command line.
        pass_fds: further descriptors that it inherits.

    Attributes:
        memory: the shared memory.
    """

    def __init__(
        self,
        module: str,
        memory: int | SharedMemory,
        arguments: Sequence[str] = (),
        pass_fds: Sequence[int] = (),
    ) -> None:
        fd = memory.fd if isinstance(memory, SharedMemory) else _memory_fd(memory)
        try:
            self.memory = memory.memory if isinstance(memory, SharedMemory) else mmap.mmap(fd, 0)
            paths = [str(_PACKAGE), *filter(None, [os.environ.get("PYTHONPATH")])]
            # In a session of its own it gets no Ctrl-C of the terminal: this process ends it.

            def started(pipe_bytes: int) -> "subprocess.Popen[bytes]":
                return subprocess.Popen(
                    [sys.executable, "-m", module, *arguments, str(fd)],
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    pass_fds=(fd, *pass_fds),
                    pipesize=pipe_bytes,
                    start_new_session=True,
                    env={**os.environ, "PYTHONPATH": os.pathsep.join(paths)},
                )

            try:
                self._process = started(_PIPE_BYTES)
            except OSError:
                # The system limits the memory of a user's pipes. Smaller ones are only slower.
                self._process = started(_AS_USUAL)
        finally:
            if not isinstance(memory, SharedMemory):
                os.close(fd)

    @property
    def pid(self) -> int:
        """Its process id."""
        return self._process.pid

    def send(self, message: Any) -> None:
        """Write an object to its input.

        Raises:
            OSError, ValueError: the process has ended, or is being ended.
        """
        send(cast(BinaryIO, self._process.stdin), message)

    def receive(self) -> Any:
        """Read an object that it wrote.

        Raises:
            EOFError, OSError, ValueError: the process has ended, or is being ended.
        """
        return receive(cast(BinaryIO, self._process.stdout))

    def close(self, timeout_s: float = 5.0) -> None:
        """End the process; kill it if it does not end within the timeout."""
        assert self._process.stdin is not None
        try:
            self._process.stdin.close()
        except OSError:
            pass  # It ended before it read everything.
        try:
            self._process.wait(timeout_s)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()


def _memory_fd(size: int) -> int:
    """A file without a name, so that none remains after a crash."""
    if hasattr(os, "memfd_create"):
        fd = os.memfd_create("markerless_tracker_images")
    else:
        with tempfile.TemporaryFile() as file:
            fd = os.dup(file.fileno())
    os.ftruncate(fd, size)
    return fd


def take_output() -> BinaryIO:
    """In the child: its output, used for answers only; other prints go to standard error."""
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    return answers
