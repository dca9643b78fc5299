"""The executable `player`."""

import sys
import time
from collections.abc import Callable, Sequence

from markerless_tracker.node.player.spin import never
from markerless_tracker.node.ros.process import (
    NOTICE_S,
    StopSignals,
    print_help,
    run_executable,
    running,
)

_SUMMARY = "Plays a bag's images and camera infos to topics, with their own stamps."
_EXAMPLE = "player --ros-args -p bag:=bag -p rate:=0.5 -p wait_for_subscribers:=true"


def main(argv: Sequence[str] | None = None) -> int:
    """Play a bag to topics; returns the exit code.

    0 at the end of the bag and after SIGINT or SIGTERM, 1 with one line on standard error for
    parameters or a bag that cannot be used.
    """
    return run_executable("player", _run, argv)


def _run(argv: list[str], stop: StopSignals) -> int:
    if "-h" in argv or "--help" in argv:
        from markerless_tracker.node.player.parameters import default_values, descriptions

        print_help("player", _SUMMARY, _EXAMPLE, descriptions(), default_values())
        return 0
    from markerless_tracker.node.player.node import PlayerNode

    with running(PlayerNode, argv) as (node, executor):

        def spin(seconds: float, until: Callable[[], bool] = never) -> bool:
            end_s = time.monotonic() + seconds
            while not (stop.received or until()):
                left_s = end_s - time.monotonic()
                executor.spin_once(timeout_sec=min(max(0.0, left_s), NOTICE_S))
                if left_s <= 0.0:
                    break
            return not stop.received

        node.play(spin)
        if not stop.received:
            node.finish(spin)
        node.get_logger().info(_summary(node.sets_played, node.playing_s, node.cpu_s))
    return 0


def _summary(sets: int, playing_s: float, cpu_s: float) -> str:
    if not sets or not playing_s:
        return f"played {sets} sets"
    return f"played {sets} sets in {playing_s:.3f} s, {1e3 * cpu_s / sets:.2f} ms of CPU time a set"


if __name__ == "__main__":
    sys.exit(main())
