"""Starts and stops an executable of this package in a ROS graph."""

import os
import shutil
import signal
import sys
import textwrap
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from functools import partial
from importlib import import_module
from typing import Any, Self

from markerless_tracker.errors import ConfigError, TrackerError
from markerless_tracker.libraries import keep_freed_memory, single_threaded
from markerless_tracker.node.ros.profile import apply_profile

NOT_INSTALLED = (
    "ROS 2 is not installed: pip install 'markerless_tracker[ros]' or source a ROS 2 Jazzy setup"
)
NOTICE_S = 0.1
"""Longest time until a signal is noticed."""
_NAME_WIDTH = 24
"""Width of the column of parameter names in `--help`, in characters."""
_NEEDED = (
    "rclpy",
    "diagnostic_msgs.msg",
    "geometry_msgs.msg",
    "sensor_msgs.msg",
    "std_srvs.srv",
    "visualization_msgs.msg",
)


class RosMissingError(TrackerError):
    """ROS 2 cannot be imported."""


def require_ros() -> None:
    """Make sure that rclpy and the message packages can be imported.

    Raises:
        RosMissingError: they cannot be imported; the message says how to install them.
    """
    try:
        for module in _NEEDED:
            import_module(module)
    except ImportError as error:
        missing = f" ({error.name} is missing)" if error.name else ""
        raise RosMissingError(NOT_INSTALLED + missing) from error


class StopSignals:
    """Records SIGINT and SIGTERM instead of interrupting running code; a context manager.

    An exception while a result is written would truncate it. An exception during an import can make
    Python exit with an error although it was caught.

    Attributes:
        received: whether a signal was received.
    """

    def __init__(self) -> None:
        self.received = False

    def __enter__(self) -> "StopSignals":
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._note)
        return self

    def __exit__(self, *_: object) -> None:
        """Ignore further signals while the process ends."""
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, signal.SIG_IGN)

    def _note(self, number: int, frame: object) -> None:
        self.received = True


def run_executable(
    name: str, body: Callable[[list[str], StopSignals], int], argv: Sequence[str] | None = None
) -> int:
    """Run an executable: one line on standard error and 1 for an error.

    Args:
        name: of the executable, for its messages.
        body: called with the arguments and the stop signals if ROS is installed; returns the exit
            code.
        argv: arguments without the program's name; None = those of this process.
    """
    single_threaded()
    keep_freed_memory()
    with StopSignals() as stop:
        try:
            apply_profile()
            require_ros()
            return body(list(sys.argv[1:] if argv is None else argv), stop)
        except (TrackerError, OSError) as error:
            print(f"{name}: {error}", file=sys.stderr, flush=True)
            return 1


def print_help(
    name: str, summary: str, example: str, lines: Mapping[str, str], defaults: Mapping[str, Any]
) -> None:
    """Print a summary of an executable, an example, and each parameter with its default.

    Args:
        name: of the executable.
        summary: one sentence.
        example: a command line.
        lines: a one-line description of each parameter.
        defaults: default values; no default if the value is None, an empty text or missing.
    """
    listed = "".join(_entry(key, line, defaults.get(key)) for key, line in lines.items())
    print(
        f"usage: {name} --ros-args [-p NAME:=VALUE ...] [--params-file FILE]\n\n{summary}\n\n"
        f"example:\n  {example}\n\nparameters [default]:\n{listed}",
        end="",
    )


def _entry(name: str, line: str, default: Any) -> str:
    """A parameter in the layout of `argparse`'s options, wrapped at the terminal's width."""
    plain = str(default).lower() if isinstance(default, bool) else default
    text = line if default is None or default == "" else f"{line} [{plain}]"
    width = max(_NAME_WIDTH + 20, shutil.get_terminal_size().columns - 2)
    indent = " " * _NAME_WIDTH
    wrapped = textwrap.fill(
        text, width, initial_indent=indent, subsequent_indent=indent,
        break_long_words=False, break_on_hyphens=False,
    )  # fmt: skip
    head = f"  {name}"
    if len(head) < _NAME_WIDTH - 1:
        return f"{head}{wrapped[len(head) :]}\n"
    return f"{head}\n{wrapped}\n"


def init_context(arguments: Sequence[str], domain_id: int | None = None) -> Any:
    """Initialise rclpy with a context of its own and ROS arguments.

    Args:
        arguments: e.g. ``["--ros-args", "-p", "seed:=1"]``.
        domain_id: the ROS domain, 0..101; None = that of the environment.

    Returns:
        The ``rclpy.Context``, which handles no signals.

    Raises:
        ConfigError: an argument that ROS does not know, or an argument outside of ``--ros-args``.
    """
    import rclpy
    from rclpy.signals import SignalHandlerOptions
    from rclpy.utilities import remove_ros_args

    try:
        rest = remove_ros_args(args=["", *arguments])[1:]
        if rest:
            raise ConfigError(
                f"argument {rest[0]!r} is not understood, expected "
                "--ros-args -p NAME:=VALUE or --params-file FILE"
            )
        context = rclpy.Context()
        rclpy.init(
            args=list(arguments),
            context=context,
            domain_id=domain_id,
            signal_handler_options=SignalHandlerOptions.NO,
        )
    except ConfigError:
        raise
    except Exception as error:  # rclpy has no common base class for errors in arguments
        raise ConfigError(f"ROS arguments: {' '.join(str(error).split())}") from error
    return context


@contextmanager
def running(
    kind: Callable[..., Any], arguments: Sequence[str] = (), domain_id: int | None = None
) -> Iterator[tuple[Any, Any]]:
    """A node and its executor in a context of their own, which end with the block.

    Args:
        kind: makes the node; called with a `context`.
        arguments, domain_id: as for `init_context`.

    Raises:
        ConfigError: ROS arguments or parameters that cannot be used.
    """
    context = init_context(arguments, domain_id)
    try:
        from rclpy.exceptions import ParameterException
        from rclpy.executors import SingleThreadedExecutor

        try:
            node = kind(context=context)
        except ParameterException as error:
            raise ConfigError(" ".join(str(error).split())) from error
        executor = SingleThreadedExecutor(context=context)
        executor.add_node(node)
        try:
            yield node, executor
        finally:
            # Destruction of the node removes the middleware's shared memory.
            executor.shutdown(timeout_sec=0)
            node.destroy_node()
    finally:
        context.try_shutdown()


class Listener(ABC):
    """Base of classes that have a node without parameters inside a `with` block; see `running`.

    Args:
        name: of the node; the number of the process is added.
        domain_id: as for `init_context`.
    """

    def __init__(self, name: str, domain_id: int | None = None) -> None:
        self._name, self._domain_id = name, domain_id

    def __enter__(self) -> Self:
        from rclpy.node import Node

        name = f"{self._name}_{os.getpid()}"
        kind = partial(Node, name, start_parameter_services=False)
        with ExitStack() as stack:
            node_and_executor = running(kind, domain_id=self._domain_id)
            self._node, self._executor = stack.enter_context(node_and_executor)
            self._subscribe_all()
            self._running = stack.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        self._running.close()

    @abstractmethod
    def _subscribe_all(self) -> None:
        """Create the subscriptions of `self._node`."""
