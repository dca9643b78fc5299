"""The executable `segmenter`."""

import os
import sys
from collections.abc import Callable, Sequence
from threading import Thread

from markerless_tracker.node.ros.process import (
    NOTICE_S,
    StopSignals,
    print_help,
    run_executable,
    running,
)

_SUMMARY = "Publishes the evidence of one camera's images, for a tracker on another machine."
_EXAMPLE = (
    "segmenter --ros-args -r __node:=segmenter_cam01 \\\n"
    "      -p camera:=cam01 -p background_dir:=empty"
)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the segmenter node until SIGINT or SIGTERM; returns the exit code.

    0 after SIGINT or SIGTERM, 1 with one line on standard error for parameters or files that
    cannot be used.
    """
    return run_executable("segmenter", _run, argv)


def _run(argv: list[str], stop: StopSignals) -> int:
    if "-h" in argv or "--help" in argv:
        from markerless_tracker.node.segmenter.parameters import (
            segmenter_defaults,
            segmenter_descriptions,
        )

        print_help("segmenter", _SUMMARY, _EXAMPLE, segmenter_descriptions(), segmenter_defaults())
        return 0
    from markerless_tracker.libraries import collect_for_good
    from markerless_tracker.node.segmenter.node import SegmenterNode

    if stop.received:
        return 0
    with running(SegmenterNode, argv) as (node, executor):
        compiled = _finished(node.warm_up, stop)
        if compiled:
            node.begin()
            collect_for_good()
        while not stop.received:
            executor.spin_once(timeout_sec=NOTICE_S)
        node.close()
    if not compiled:
        # A compilation cannot be interrupted, and Python would wait for its end.
        sys.stdout.flush()
        os._exit(0)
    return 0


def _finished(work: Callable[[], None], stop: StopSignals) -> bool:
    """Whether work in a thread of its own has ended before a signal came; raises its error."""
    failed: list[Exception] = []

    def run() -> None:
        try:
            work()
        except Exception as error:
            failed.append(error)

    thread = Thread(target=run, daemon=True)
    thread.start()
    while thread.is_alive() and not stop.received:
        thread.join(NOTICE_S)
    if failed:
        raise failed[0]
    return not thread.is_alive()


if __name__ == "__main__":
    sys.exit(main())
