"""The segmenting thread: images in their order, evidence out."""

import time
from collections import deque
from collections.abc import Callable
from threading import Condition, Event, Lock, Thread
from typing import Any, NamedTuple

import numpy as np

from markerless_tracker.errors import one_line
from markerless_tracker.observation import Observation

QUEUE = 8
"""Largest number of images that wait."""
SHARE_MAX = 64
CALM = 60
"""Number of consecutive images that did not wait, after which more images are kept again."""
_MIXER = 0x9E3779B97F4A7C15
WINDOW = 300
"""Images over which latency is computed."""


class Waiting(NamedTuple):
    """An image that waits to be segmented, and its time of arrival in s."""

    stamp_ns: int
    message: Any
    arrived_s: float


class ImageQueue:
    """A queue of images in the order of their arrival, thinned out if they come too fast.

    If not all images can be segmented, one of 2, 4, 8... is kept on average, chosen by a hash of
    the stamp, so that the segmenters of other cameras keep the same sets.

    Attributes:
        received, dropped: counts of images.
        share: one image of this many is kept.
        last_arrival_s: time of the last arrival, s; None before the first.
    """

    def __init__(self) -> None:
        self._images: deque[Waiting] = deque()
        self._changed = Condition()
        self._calm = 0
        self.received = self.dropped = 0
        self.share = 1
        self.last_arrival_s: float | None = None

    def add(self, camera: str, stamp_ns: int, view: Any, *, now_s: float) -> bool:
        """Store an image; as `Synchronizer.add`. Returns whether it is kept."""
        with self._changed:
            self.received += 1
            self.last_arrival_s = now_s
            if not self._kept(stamp_ns):
                self.dropped += 1
                return False
            if len(self._images) >= QUEUE:
                self._thin_out()
            self._images.append(Waiting(stamp_ns, view, now_s))
            self._changed.notify()
        return True

    def take(self, timeout_s: float) -> Waiting | None:
        """The oldest image; None if no image came in time."""
        with self._changed:
            if not self._images:
                self._changed.wait(timeout_s)
            if not self._images:
                return None
            taken = self._images.popleft()
            self._calm = 0 if self._images else self._calm + 1
            if self._calm >= CALM and self.share > 1:
                self.share, self._calm = self.share // 2, 0
            return taken

    def _kept(self, stamp_ns: int) -> bool:
        # The high bits of the product depend on all bits of the stamp.
        return (stamp_ns * _MIXER >> 40) % self.share == 0

    def _thin_out(self) -> None:
        """Keep half as many images from now on, also of the waiting ones; drop at least one."""
        self.share, self._calm = min(2 * self.share, SHARE_MAX), 0
        kept = deque(image for image in self._images if self._kept(image.stamp_ns))
        if len(kept) >= QUEUE:
            kept.popleft()
        self.dropped += len(self._images) - len(kept)
        self._images = kept


class SegmenterStatus:
    """Counts, times and errors. Safe to use from several threads."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._latencies_s: deque[float] = deque(maxlen=WINDOW)
        counts = ("published", "failed", "refused", "lost", "bytes_in", "bytes_out")
        self._counts = dict.fromkeys(counts, 0)
        self._last_error = self._trouble = ""

    def refused(self, camera: str) -> None:
        """Count an unusable image."""
        with self._lock:
            self._counts["refused"] += 1

    def lost(self, camera: str, images: int) -> None:
        """Count images that were sent and not received."""
        with self._lock:
            self._counts["lost"] += images

    def failed(self, message: str) -> None:
        """Record an error."""
        with self._lock:
            self._last_error = message

    def failed_image(self, message: str) -> None:
        """Count an image without evidence, and keep the reason until evidence is published."""
        with self._lock:
            self._counts["failed"] += 1
            self._last_error = self._trouble = message

    @property
    def trouble(self) -> str:
        """Why the last image has no evidence; empty if it has."""
        with self._lock:
            return self._trouble

    def published(self, bytes_in: int, bytes_out: int, latency_s: float) -> None:
        """Count an image whose evidence was published."""
        with self._lock:
            self._trouble = ""
            self._counts["published"] += 1
            self._counts["bytes_in"] += bytes_in
            self._counts["bytes_out"] += bytes_out
            self._latencies_s.append(latency_s)

    def values(self) -> dict[str, str]:
        """Everything as text, by key.

        `bytes_in`: bytes of the segmented images, still compressed if they come so; `bytes_out`:
        bytes of the evidence; `latency_median_ms`, `latency_p95_ms`: from an image's arrival to the
        publication of its evidence.
        """
        with self._lock:
            times = np.array(self._latencies_s) * 1e3
            return {
                **{name: str(count) for name, count in self._counts.items()},
                "latency_median_ms": f"{np.median(times):.1f}" if times.size else "nan",
                "latency_p95_ms": f"{np.percentile(times, 95):.1f}" if times.size else "nan",
                "last_error": self._last_error,
            }


class SegmentWorker:
    """A thread that segments one image after the other.

    An error in one image is reported and costs that image.

    Args:
        images: source of the images.
        status: receives counts, times and errors.
        observe: makes the evidence of an image message.
        publish: sends evidence; returns its bytes.
        report: called with each error, one line.
        clock: monotonic time in s.
    """

    def __init__(
        self,
        images: ImageQueue,
        status: SegmenterStatus,
        *,
        observe: Callable[[Waiting], Observation],
        publish: Callable[[Observation], int],
        report: Callable[[str], None],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._images, self._status = images, status
        self._observe, self._publish, self._report = observe, publish, report
        self._clock = clock
        self._stop = Event()
        self._thread = Thread(target=self._run, name="segment", daemon=True)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def stop(self, timeout_s: float = 3.0) -> bool:
        """Finish the present image and end; returns whether the thread ended in time."""
        self._stop.set()
        if self._thread.ident is not None:
            self._thread.join(timeout_s)
        return not self._thread.is_alive()

    def _run(self) -> None:
        while not self._stop.is_set():
            waiting = self._images.take(0.2)
            if waiting is None:
                continue
            try:
                sent = self._publish(self._observe(waiting))
            except Exception as error:
                # The next image may be fine.
                text = f"stamp {waiting.stamp_ns}: {one_line(error)}"
                self._status.failed_image(text)
                self._report(text)
                continue
            size = len(waiting.message.data)
            self._status.published(size, sent, self._clock() - waiting.arrived_s)
