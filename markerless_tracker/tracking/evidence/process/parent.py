"""The segmenting process as its parent sees it."""

import mmap
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from threading import Lock, Thread
from typing import Any, BinaryIO, cast

import numpy as np

from markerless_tracker.camera import CameraRig
from markerless_tracker.imaging import BackgroundModel, Image, Region
from markerless_tracker.tracking.config import TrackerConfig
from markerless_tracker.tracking.evidence.prepared import SeenView
from markerless_tracker.tracking.evidence.process.wire import Place, Request, receive, send

_CHILD = "markerless_tracker.tracking.evidence.process.child"
_ALIGNED = 64
_END_S = 5.0


class SegmentingProcess:
    """A process that segments images; ends with this one, or when it is closed.

    Images are copied into shared memory once. A process that has ended is not started again:
    `segment` gives None from then on. Safe to use from several threads.

    Args:
        rig: the cameras, whose sizes say how much memory is shared.
    """

    def __init__(self, rig: CameraRig) -> None:
        self._rig = rig
        self._lock = Lock()
        self._ready = False
        self._cpu_s = 0.0
        size = sum(_aligned(3 * width * height) for width, height in (c.size_px for c in rig))
        fd = _memory_fd(size)
        try:
            self._memory = mmap.mmap(fd, size)
            package = str(Path(__file__).resolve().parents[4])
            paths = [package, *filter(None, [os.environ.get("PYTHONPATH")])]
            # A session of its own: a terminal's Ctrl-C is for this process, which ends the other.
            self._process = subprocess.Popen(
                [sys.executable, "-m", _CHILD, str(fd)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                pass_fds=(fd,),
                start_new_session=True,
                env={**os.environ, "PYTHONPATH": os.pathsep.join(paths)},
            )
        finally:
            os.close(fd)

    @property
    def pid(self) -> int:
        """Its process id."""
        return self._process.pid

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
            offset, places = 0, {}
            for name, image in images.items():
                if offset + image.size > len(self._memory):
                    return None
                shared = np.frombuffer(self._memory, np.uint8, image.size, offset)
                np.copyto(shared.reshape(image.shape), image)
                places[name] = Place(offset, image.shape, regions[name])
                offset += _aligned(image.size)
            answer = self._ask(Request(stamp_ns, places))
        if isinstance(answer, Exception):
            raise answer
        if answer is None:
            return None
        seen = cast(dict[str, SeenView], answer)
        return {name: view._replace(image=images[name]) for name, view in seen.items()}

    def close(self) -> None:
        """End the process."""
        assert self._process.stdin is not None
        try:
            self._process.stdin.close()
        except OSError:
            pass  # It ended with something left to read.
        try:
            self._process.wait(_END_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def _begin(self, message: Any) -> None:
        try:
            self._ready = self._ask(message) is True
        finally:
            self._lock.release()

    def _ask(self, message: Any) -> Any:
        """Send a message; returns the answer, None if the process has ended."""
        try:
            send(cast(BinaryIO, self._process.stdin), message)
            answer, self._cpu_s = receive(cast(BinaryIO, self._process.stdout))
        except (EOFError, OSError, ValueError):
            self._ready = False
            return None
        return answer


def _aligned(size: int) -> int:
    return -(-size // _ALIGNED) * _ALIGNED


def _memory_fd(size: int) -> int:
    """A file without a name, so that nothing is left behind whatever happens."""
    if hasattr(os, "memfd_create"):
        fd = os.memfd_create("markerless_tracker_images")
    else:
        with tempfile.TemporaryFile() as file:
            fd = os.dup(file.fileno())
    os.ftruncate(fd, size)
    return fd
