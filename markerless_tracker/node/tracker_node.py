"""The executable `tracker`."""

import os
import signal
import sys
from collections.abc import Sequence

from markerless_tracker.node.ros import init_context, run_executable

_CLOSE_S = 5.0


def main(argv: Sequence[str] | None = None) -> int:
    """Run the tracker node until SIGINT or SIGTERM; returns the exit code.

    0 after a signal, 1 with one line on standard error for parameters or files that cannot be used.
    """
    return run_executable("tracker", _run, argv)


def _run(argv: list[str]) -> int:
    context = init_context(argv)
    from rclpy.exceptions import ParameterException
    from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor

    from markerless_tracker.errors import ConfigError
    from markerless_tracker.node.tracker import TrackerNode

    node = None
    executor = SingleThreadedExecutor(context=context)
    ended = True
    try:
        try:
            node = TrackerNode(context=context)
        except ParameterException as error:
            raise ConfigError(" ".join(str(error).split())) from error
        executor.add_node(node)
        while context.ok() and node.fatal is None:
            executor.spin_once(timeout_sec=0.2)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        # Closing is short; a second signal must not cut the result file.
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        executor.shutdown(timeout_sec=0)
        if node is not None:
            ended = node.close(_CLOSE_S)
            node.destroy_node()
        context.try_shutdown()
    code = 0
    if node is not None and node.fatal is not None:
        print(f"tracker: {node.fatal}", file=sys.stderr, flush=True)
        code = 1
    if not ended:
        # The compiler cannot be interrupted, and Python would wait for it.
        sys.stdout.flush()
        os._exit(code)
    return code


if __name__ == "__main__":
    sys.exit(main())
