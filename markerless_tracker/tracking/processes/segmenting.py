"""The segmenting process as its parent sees it."""

from collections.abc import Mapping
from threading import Lock, Thread
from typing import Any, NamedTuple, cast

from markerless_tracker.camera import CameraRig
from markerless_tracker.imaging import BackgroundModel, Image, Region
from markerless_tracker.tracking.config import TrackerConfig
from markerless_tracker.tracking.evidence.prepared import SeenView
from markerless_tracker.tracking.processes.child import Child, SharedMemory
from markerless_tracker.tracking.processes.images import Place, put, set_bytes

_MAIN = "markerless_tracker.tracking.processes.segmenting_main"


class SegmentRequest(NamedTuple):
    """Images of one time to segment, by camera: where they lie, and which part; None = all."""

    stamp_ns: int
    images: dict[str, Place]
    regions: dict[str, Region | None]


class SegmentingProcess:
    """A process that segments images; ends with this one, or when it is closed.

    Images are copied into shared memory, unless that is given: then they must lie there. A process
    that has ended is not started again: `segment` gives None from then on. Safe to use from several
    threads.

    Args:
        rig: the cameras, whose sizes say how much memory is shared.
        shared: memory that is shared already, and that the images lie in.
    """

    def __init__(self, rig: CameraRig, shared: SharedMemory | None = None) -> None:
        self._rig = rig
        self._lock = Lock()
        self._ready = False
        self._cpu_s = 0.0
        self._child = Child(_MAIN, shared or set_bytes(rig))
        self._own_bytes = 0 if shared else len(self._child.memory)

    @property
    def pid(self) -> int:
        """Its process id."""
        return self._child.pid

    @property
    def cpu_s(self) -> float:
        """CPU time that it had taken when it last answered, s."""
        return self._cpu_s

    def use(self, config: TrackerConfig, backgrounds: Mapping[str, BackgroundModel]) -> None:
        """Use these backgrounds from now on; returns before the process is ready for that."""
        message = self._rig, config, dict(backgrounds)
        self._lock.acquire()
        # Released when the process is ready: until then everybody else waits.
        Thread(target=self._begin, args=(message,), name="segmenting", daemon=True).start()

    def wait(self) -> None:
        """Wait until it uses the backgrounds, or has ended."""
        with self._lock:
            pass

    def segment(
        self,
        images: Mapping[str, Image],
        stamp_ns: int,
        regions: Mapping[str, Region | None],
    ) -> dict[str, SeenView] | None:
        """As `EvidenceMaker.segment_regions`; None if the process cannot do it.

        Waits for a process that is not ready yet.

        Raises:
            TrackerError: what the segmentation raised.
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

    def close(self) -> None:
        """End the process."""
        self._child.close()

    def _begin(self, message: Any) -> None:
        try:
            self._ready = self._ask(message) is True
        finally:
            self._lock.release()

    def _ask(self, message: Any) -> Any:
        """Send a message; returns the answer, None if the process has ended."""
        try:
            self._child.send(message)
            answer, self._cpu_s = self._child.receive()
        except (EOFError, OSError, ValueError):
            self._ready = False
            return None
        return answer
