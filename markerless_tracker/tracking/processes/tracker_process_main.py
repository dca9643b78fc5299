"""Main program of a tracker's process: sets of images in, results out, until its input ends.

Started as ``python -m markerless_tracker.tracking.processes.tracker_process_main SETS MADE FD``
with three descriptors: SETS gives the sets to prepare, MADE takes the answers to these, FD is the
shared memory. Standard input gives the other requests of the parent; standard output takes only the
answers.
"""

import mmap
import os
import pickle
import sys
import time
from importlib import import_module
from threading import Lock, Thread
from typing import TYPE_CHECKING, Any, BinaryIO

from markerless_tracker.libraries import collect_for_good, keep_freed_memory, single_threaded

if TYPE_CHECKING:
    from markerless_tracker.imaging import Image
    from markerless_tracker.records import Observation
    from markerless_tracker.tracking.processes.child import SharedMemory
    from markerless_tracker.tracking.processes.tracker_process import SetOfViews, Step, Tracked
    from markerless_tracker.tracking.tracker import Tracker


def main(sets_fd: int, made_fd: int, memory_fd: int) -> int:
    """Serve until the parent ends; returns the exit status."""
    single_threaded()
    keep_freed_memory()
    from markerless_tracker.tracking.processes.child import SharedMemory, take_output

    service = Service(SharedMemory(memory_fd, mmap.mmap(memory_fd, 0)))
    sets, made = os.fdopen(sets_fd, "rb"), os.fdopen(made_fd, "wb")
    Thread(target=_until_end, args=(service.serve_sets, sets, made), daemon=True).start()
    _until_end(service.serve, sys.stdin.buffer, take_output())
    service.close()
    return 0


class Service:
    """A tracker that answers its parent's requests.

    Args:
        shared: memory shared with the parent; holds the images.
    """

    def __init__(self, shared: "SharedMemory") -> None:
        # Imported while the parent starts.
        import cv2

        import_module("markerless_tracker.tracking")
        # OpenCV's threads wait in busy loops, which would take cores from the other processes.
        cv2.setNumThreads(1)
        self._shared = shared
        self._tracker: Tracker | None = None
        self._reported: Any = None
        self._known: Any = None
        self._lock = Lock()
        self._prepared: dict[int, Any] = {}

    def close(self) -> None:
        """End the tracker's segmenting process."""
        if self._tracker is not None:
            self._tracker.evidence.close()

    def serve(self, requests: BinaryIO, answers: BinaryIO) -> None:
        """Answer requests; each answer is the result or the exception, and the CPU time.

        The first request is a function that makes the tracker.

        Raises:
            EOFError, BrokenPipeError: the parent has ended.
        """
        from markerless_tracker.compiled import compilation
        from markerless_tracker.tracking.processes.tracker_process import Call, Compiled, Step
        from markerless_tracker.tracking.processes.wire import receive, send

        def progress(name: str, done: int, most: int) -> None:
            send(answers, Compiled(name, done, most))

        while True:
            request = receive(requests)
            answer: Any = None
            try:
                if isinstance(request, Step):
                    answer = self._step(request)
                elif isinstance(request, Call):
                    with compilation(progress):
                        found = getattr(self.tracker, request.method)
                        answer = found(*request.arguments) if callable(found) else found
                    if request.method == "warm_up":
                        collect_for_good()
                else:
                    self._tracker = request()
                    self.tracker.evidence.start_process(self._shared)
            except Exception as error:
                answer = _portable(error)
            cpu_s = time.process_time()
            if self._tracker is not None:
                cpu_s += self._tracker.evidence.process_cpu_s
            send(answers, (answer, cpu_s))

    def serve_sets(self, sets: BinaryIO, made: BinaryIO) -> None:
        """Prepare sets; each answer is None, or the exception.

        Raises:
            EOFError, BrokenPipeError: the parent has ended.
        """
        from markerless_tracker.tracking.processes.wire import receive, send

        while True:
            asked: SetOfViews = receive(sets)
            error: Exception | None = None
            try:
                prepared = self.tracker.prepare(self._views(asked), asked.stamp_ns)
                with self._lock:
                    self._prepared[asked.number] = prepared
            except Exception as raised:
                error = _portable(raised)
            send(made, error)

    @property
    def tracker(self) -> "Tracker":
        """The tracker."""
        if self._tracker is None:
            raise RuntimeError("a request came before the tracker")
        return self._tracker

    def _step(self, step: "Step") -> "Tracked":
        from markerless_tracker.tracking.processes.tracker_process import Tracked

        asked = step.views
        with self._lock:
            prepared = self._prepared.pop(asked.number, None)
            # Sets that were prepared and then skipped.
            for number in [n for n in self._prepared if n < asked.number]:
                del self._prepared[number]
        views = self._views(asked) if prepared is None else prepared
        result = self.tracker.step(views, asked.stamp_ns, step.effort)
        body = self.tracker.body
        reported, self._reported = self._reported, body
        rig = self.tracker.rig
        known, self._known = self._known, rig
        return Tracked(result, None if body is reported else body, None if rig is known else rig)

    def _views(self, asked: "SetOfViews") -> "dict[str, Image | Observation]":
        from markerless_tracker.tracking.processes.images import Place, get

        return {
            name: get(self._shared.memory, view) if isinstance(view, Place) else view
            for name, view in asked.views.items()
        }


def _portable(error: Exception) -> Exception:
    """The error; a `RuntimeError` with its text if it cannot be pickled."""
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        return RuntimeError(f"{type(error).__name__}: {error}")
    return error


def _until_end(serve: Any, requests: BinaryIO, answers: BinaryIO) -> None:
    try:
        serve(requests, answers)
    except (EOFError, BrokenPipeError):
        pass  # The parent has ended.


if __name__ == "__main__":
    sys.exit(main(*map(int, sys.argv[1:])))
