"""The executable `tracker`."""

import os
import sys
from collections.abc import Sequence
from typing import Any

from markerless_tracker.errors import ConfigError, TrackerError
from markerless_tracker.node.ros.process import (
    StopSignals,
    init_context,
    print_help,
    run_executable,
)

_SUMMARY = "Tracks a person in the images of several calibrated cameras."
_EXAMPLE = (
    "tracker --ros-args -p calibration_file:=bag/calibration.toml "
    "-p background_dir:=bag/background -p stature:=1.75"
)
_CLOSE_S = 3.0
_SWITCH_S = 0.001
"""Time after which a thread that runs Python gives way to another one."""
_NOTICE_S = 0.1
"""Longest time until a signal is noticed."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the tracker node until SIGINT or SIGTERM; returns the exit code.

    0 after SIGINT or SIGTERM, 1 with one line on standard error for parameters or files that
    cannot be used.
    """
    return run_executable("tracker", _run, argv)


def _run(argv: list[str], stop: StopSignals) -> int:
    if "-h" in argv or "--help" in argv:
        from markerless_tracker.node.tracker.parameters import descriptions

        print_help("tracker", _SUMMARY, _EXAMPLE, descriptions())
        return 0
    # The compiled passes give the interpreter up, and would wait for it up to 5 ms each.
    sys.setswitchinterval(_SWITCH_S)
    context = init_context(argv)
    try:
        return _serve(context, stop)
    finally:
        context.try_shutdown()


def _serve(context: Any, stop: StopSignals) -> int:
    from rclpy.exceptions import ParameterException
    from rclpy.executors import SingleThreadedExecutor

    from markerless_tracker.node.tracker.node import TrackerNode

    if stop.asked:
        return 0
    try:
        node = TrackerNode(context=context)
    except ParameterException as error:
        raise ConfigError(" ".join(str(error).split())) from error
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    while node.fatal is None and not stop.asked:
        executor.spin_once(timeout_sec=_NOTICE_S)
    trouble, ended = node.fatal, False
    try:
        ended = node.close(_CLOSE_S)
    except TrackerError as unfinished:
        trouble = trouble or str(unfinished)
    if trouble is not None:
        print(f"tracker: {trouble}", file=sys.stderr, flush=True)
    # Destroying the node removes the shared memory of the middleware.
    executor.shutdown(timeout_sec=0)
    node.destroy_node()
    if not ended:
        # The compiler cannot be interrupted, and Python would wait for it.
        context.try_shutdown()
        sys.stdout.flush()
        os._exit(0 if trouble is None else 1)
    return 0 if trouble is None else 1


if __name__ == "__main__":
    sys.exit(main())
