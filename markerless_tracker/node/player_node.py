"""The executable `player`."""

import sys
import time
from collections.abc import Sequence

from markerless_tracker.node.ros import init_context, run_executable


def main(argv: Sequence[str] | None = None) -> int:
    """Play a bag to topics; returns the exit code.

    0 at the end of the bag and after a signal, 1 with one line on standard error for parameters or
    a bag that cannot be used.
    """
    return run_executable("player", _run, argv)


def _run(argv: list[str]) -> int:
    context = init_context(argv)
    from rclpy.exceptions import ParameterException
    from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor

    from markerless_tracker.errors import ConfigError
    from markerless_tracker.node.player import PlayerNode

    executor = SingleThreadedExecutor(context=context)
    node = None

    def spin(seconds: float) -> bool:
        until_s = time.monotonic() + seconds
        while context.ok():
            left_s = until_s - time.monotonic()
            executor.spin_once(timeout_sec=max(0.0, left_s))
            if left_s <= 0.0:
                return bool(context.ok())
        return False

    try:
        try:
            node = PlayerNode(context=context)
        except ParameterException as error:
            raise ConfigError(" ".join(str(error).split())) from error
        executor.add_node(node)
        node.play(spin)
        if context.ok():
            node.finish(spin)
            node.get_logger().info(f"played {node.sets_played} sets")
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        executor.shutdown(timeout_sec=0)
        if node is not None:
            node.destroy_node()
        context.try_shutdown()
    return 0


if __name__ == "__main__":
    sys.exit(main())
