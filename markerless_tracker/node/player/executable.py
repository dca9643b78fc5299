"""The executable `player`."""

import sys
import time
from collections.abc import Sequence
from typing import Any

from markerless_tracker.errors import ConfigError
from markerless_tracker.node.ros.process import (
    StopSignals,
    init_context,
    print_help,
    run_executable,
)

_SUMMARY = "Plays a bag's images and camera infos to topics, with their own stamps."
_EXAMPLE = "player --ros-args -p bag:=bag -p rate:=0.5 -p wait_for_subscribers:=true"
# Longest time until a signal is noticed.
_NOTICE_S = 0.1


def main(argv: Sequence[str] | None = None) -> int:
    """Play a bag to topics; returns the exit code.

    0 at the end of the bag and after SIGINT or SIGTERM, 1 with one line on standard error for
    parameters or a bag that cannot be used.
    """
    return run_executable("player", _run, argv)


def _run(argv: list[str], stop: StopSignals) -> int:
    if "-h" in argv or "--help" in argv:
        from markerless_tracker.node.player.parameters import descriptions

        print_help("player", _SUMMARY, _EXAMPLE, descriptions())
        return 0
    context = init_context(argv)
    try:
        return _play(context, stop)
    finally:
        context.try_shutdown()


def _play(context: Any, stop: StopSignals) -> int:
    from rclpy.exceptions import ParameterException
    from rclpy.executors import SingleThreadedExecutor

    from markerless_tracker.node.player.node import PlayerNode

    try:
        node = PlayerNode(context=context)
    except ParameterException as error:
        raise ConfigError(" ".join(str(error).split())) from error
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)

    def spin(seconds: float) -> bool:
        until_s = time.monotonic() + seconds
        while not stop.asked:
            left_s = until_s - time.monotonic()
            executor.spin_once(timeout_sec=min(max(0.0, left_s), _NOTICE_S))
            if left_s <= 0.0:
                break
        return not stop.asked

    node.play(spin)
    if not stop.asked:
        node.finish(spin)
    node.get_logger().info(_summary(node.sets_played, node.playing_s, node.cpu_s))
    executor.shutdown(timeout_sec=0)
    node.destroy_node()
    return 0


def _summary(sets: int, playing_s: float, cpu_s: float) -> str:
    if not sets or not playing_s:
        return f"played {sets} sets"
    return f"played {sets} sets in {playing_s:.3f} s, {1e3 * cpu_s / sets:.2f} ms of CPU time a set"


if __name__ == "__main__":
    sys.exit(main())
