"""The parent's side of the segmenting process."""

from collections.abc import Mapping
from threading import Lock, Thread
from typing import Any, NamedTuple, cast

from markerless_tracker.camera import CameraRig
from markerless_tracker.compiled import compiled_elsewhere
from markerless_tracker.errors import one_line
from markerless_tracker.imaging import BackgroundModel, Image, Region
from markerless_tracker.tracking.config import TrackerConfig
from markerless_tracker.tracking.evidence.prepared import SeenView
from markerless_tracker.tracking.processes.child import Child, SharedMemory
from markerless_tracker.tracking.processes.images import Place, put, set_bytes

_MAIN = "markerless_tracker.tracking.evidence.segmenting_main"


class SegmentRequest(NamedTuple):
    """Images of one time to segment, by camera: their places and regions (None = whole image)."""

    stamp_ns: int
    images: dict[str, Place]
    regions: dict[str, Region | None]


class Ready(NamedTuple):
    """Answer to new backgrounds: the process uses them, and has compiled so many kernels."""

    compiled: int


class SegmentingProcess:
    """A process that segments images; it ends with this one, or when it is closed.

    Images are copied into shared memory. If shared memory is given, they must lie in it. A process
    that has ended is not restarted; `segment` then returns None. Safe to use from several threads.

    Args:
        rig: the cameras, whose sizes determine the size of the shared memory.
        shared: memory that is shared already and holds the images.
    """

    def __init__(self, rig: CameraRig, shared: SharedMemory | None = None) -> None:
        self._rig = rig
        self._lock = Lock()
        self._ready = self._closed = False
        self._fault: str | None = None
        self._cpu_s = 0.0
        self._child = Child(_MAIN, shared or set_bytes(rig))
        self._own_bytes = 0 if shared else len(self._child.memory)

    @property
    def pid(self) -> int:
        """Its process id."""
        return self._child.pid

    @property
    def cpu_s(self) -> float:
        """CPU time of the process at its last answer, s."""
        return self._cpu_s

    def use(self, config: TrackerConfig, backgrounds: Mapping[str, BackgroundModel]) -> None:
        """Use these backgrounds from now on; returns before the process is ready."""
        message = self._rig, config, dict(backgrounds)
        self._lock.acquire()
        # The thread releases the lock when the process is ready; other calls wait for it.
        Thread(target=self._begin, args=(message,), name="segmenting", daemon=True).start()

    def wait(self) -> None:
        """Wait until the process uses the backgrounds, or has ended."""
        with self._lock:
            pass

    def segment(
        self,
        images: Mapping[str, Image],
        stamp_ns: int,
        regions: Mapping[str, Region | None],
    ) -> dict[str, SeenView] | None:
        """As `EvidenceMaker.segment_regions`; None if the process cannot do it.

        Waits until the process is ready.

        Raises:
            TrackerError: raised by the segmentation.
        """
        with self._lock:
            if not self._ready:
                return None
            places = put(self._child.memory, images, 0, self._own_bytes)
            if places is None:
                return None
            parts = {name: regions[name] for name in images}
            answer = self._ask(SegmentRequest(stamp_ns, places, parts))
        if isinstance(answer, Exception):
            raise answer
        if answer is None:
            return None
        seen = cast(dict[str, SeenView], answer)
        return {name: view._replace(image=images[name]) for name, view in seen.items()}

    def take_fault(self) -> str | None:
        """Why the process cannot segment, told once; None if it can, or was not asked yet."""
        fault, self._fault = self._fault, None
        return fault

    def close(self) -> None:
        """End the process."""
        self._closed = True
        self._child.close()

    def _begin(self, message: Any) -> None:
        try:
            answer = self._ask(message)
            self._ready = isinstance(answer, Ready)
            if isinstance(answer, Exception):
                self._fault = one_line(answer)
            if isinstance(answer, Ready):
                compiled_elsewhere("segmentation", answer.compiled, answer.compiled)
        finally:
            self._lock.release()

    def _ask(self, message: Any) -> Any:
        """Send a message; returns the answer, None if the process has ended."""
        try:
            self._child.send(message)
            answer, self._cpu_s = self._child.receive()
        except (EOFError, OSError, ValueError):
            self._ready = False
            if not self._closed:
                self._fault = "the segmenting process has ended"
            return None
        return answer
