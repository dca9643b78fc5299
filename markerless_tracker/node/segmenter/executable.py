"""The executable `segmenter`."""

import sys
from collections.abc import Sequence
from typing import Any

from markerless_tracker.errors import ConfigError
from markerless_tracker.node.ros.process import (
    StopSignals,
    init_context,
    print_help,
    run_executable,
)

_SUMMARY = "Publishes the evidence of one camera's images, for a tracker on another machine."
_EXAMPLE = (
    "segmenter --ros-args -r __node:=segmenter_cam01 -p camera:=cam01 -p background_dir:=empty"
)
# Longest time until a signal is noticed.
_NOTICE_S = 0.1


def main(argv: Sequence[str] | None = None) -> int:
    """Run the segmenter node until SIGINT or SIGTERM; returns the exit code.

    0 after SIGINT or SIGTERM, 1 with one line on standard error for parameters or files that
    cannot be used.
    """
    return run_executable("segmenter", _run, argv)


def _run(argv: list[str], stop: StopSignals) -> int:
    if "-h" in argv or "--help" in argv:
        from markerless_tracker.node.segmenter.parameters import segmenter_descriptions

        print_help("segmenter", _SUMMARY, _EXAMPLE, segmenter_descriptions())
        return 0
    context = init_context(argv)
    try:
        return _serve(context, stop)
    finally:
        context.try_shutdown()


def _serve(context: Any, stop: StopSignals) -> int:
    from rclpy.exceptions import ParameterException
    from rclpy.executors import SingleThreadedExecutor

    from markerless_tracker.libraries import collect_for_good
    from markerless_tracker.node.segmenter.node import SegmenterNode

    if stop.asked:
        return 0
    try:
        node = SegmenterNode(context=context)
    except ParameterException as error:
        raise ConfigError(" ".join(str(error).split())) from error
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    node.begin()
    collect_for_good()
    while not stop.asked:
        executor.spin_once(timeout_sec=_NOTICE_S)
    node.close()
    # Destroying the node removes the shared memory of the middleware.
    executor.shutdown(timeout_sec=0)
    node.destroy_node()
    return 0


if __name__ == "__main__":
    sys.exit(main())
