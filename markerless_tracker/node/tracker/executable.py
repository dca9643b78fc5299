"""The executable `tracker`."""

import os
import sys
from collections.abc import Sequence

from markerless_tracker.errors import TrackerError
from markerless_tracker.libraries import touch_memory
from markerless_tracker.node.ros.process import (
    NOTICE_S,
    StopSignals,
    print_help,
    run_executable,
    running,
)

_SUMMARY = "Tracks a person in the images of several calibrated cameras."
_EXAMPLE = (
    "tracker --ros-args -p calibration_file:=bag/calibration.toml \\\n"
    "      -p background_dir:=bag/background -p stature:=1.75"
)
_CLOSE_S = 3.0
_SWITCH_S = 0.001
"""Python's thread switch interval."""
_WAITING_BYTES = 128 << 20
"""Images that wait during the search for a person: four cameras of 800x600 px for about a second
and a half. Receiving into new memory can take longer than the images take to come."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the tracker node until SIGINT or SIGTERM; returns the exit code.

    0 after SIGINT or SIGTERM, 1 with one line on standard error for parameters or files that
    cannot be used.
    """
    return run_executable("tracker", _run, argv)


def _run(argv: list[str], stop: StopSignals) -> int:
    if "-h" in argv or "--help" in argv:
        from markerless_tracker.node.tracker.parameters import default_values, descriptions

        print_help("tracker", _SUMMARY, _EXAMPLE, descriptions(), default_values())
        return 0
    # Compiled kernels release the interpreter's lock, and would wait up to 5 ms to get it back.
    sys.setswitchinterval(_SWITCH_S)
    from markerless_tracker.node.tracker.node import TrackerNode

    if stop.received:
        return 0
    touch_memory(_WAITING_BYTES)
    with running(TrackerNode, argv) as (node, executor):
        while node.fatal is None and not stop.received:
            executor.spin_once(timeout_sec=NOTICE_S)
        trouble, ended = node.fatal, False
        try:
            ended = node.close(_CLOSE_S)
        except TrackerError as unfinished:
            trouble = trouble or str(unfinished)
        if trouble is not None:
            print(f"tracker: {trouble}", file=sys.stderr, flush=True)
    if not ended:
        # A compilation cannot be interrupted, and Python would wait for its end.
        sys.stdout.flush()
        os._exit(0 if trouble is None else 1)
    return 0 if trouble is None else 1


if __name__ == "__main__":
    sys.exit(main())
