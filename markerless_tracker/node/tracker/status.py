"""What a running tracker says about itself; collected by several threads, read by one."""

from collections import Counter, deque
from collections.abc import Mapping, Sequence
from threading import Lock

import numpy as np

from markerless_tracker.node.tracker.synchronizer import SyncCounts
from markerless_tracker.records import LimbState, TrackResult, TrackState

WINDOW = 300
"""Frames over which latency and rate are taken."""


class TrackerStatus:
    """Counts, times and troubles of a tracker since it began. Safe to use from several threads."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._ready = False
        self._activity = "starting"
        self._tracked = 0
        self._dropped: Counter[str] = Counter()
        self._refused: Counter[str] = Counter()
        self._lost: Counter[str] = Counter()
        self._latencies_s: deque[float] = deque(maxlen=WINDOW)
        self._finished_s: deque[float] = deque(maxlen=WINDOW)
        self._result: TrackResult | None = None
        self._last_error = ""

    @property
    def ready(self) -> bool:
        """Whether the kernels are compiled and images are tracked as they come."""
        with self._lock:
            return self._ready

    @property
    def stamp_ns(self) -> int:
        """Stamp of the last result, 0 before the first."""
        with self._lock:
            return 0 if self._result is None else self._result.stamp_ns

    @property
    def state(self) -> TrackState:
        """State after the last result; SEARCHING before the first."""
        with self._lock:
            return TrackState.SEARCHING if self._result is None else self._result.state

    @property
    def activity(self) -> str:
        """What goes on, in a few words."""
        with self._lock:
            return self._activity

    def doing(self, activity: str, *, ready: bool | None = None) -> None:
        """Say in a few words what goes on, and whether the tracker is ready."""
        with self._lock:
            self._activity = activity
            if ready is not None:
                self._ready = ready

    def tracked(self, result: TrackResult, *, arrived_s: float, finished_s: float) -> None:
        """Note a result and its times, both of one clock that only goes forward."""
        with self._lock:
            self._tracked += 1
            self._result = result
            self._latencies_s.append(finished_s - arrived_s)
            self._finished_s.append(finished_s)

    def dropped(self, reason: str, sets: int = 1) -> None:
        """Note complete sets that were not tracked, e.g. ``before_ready``."""
        with self._lock:
            self._dropped[reason] += sets

    def refused(self, camera: str) -> None:
        """Note an image that could not be used."""
        with self._lock:
            self._refused[camera] += 1

    def lost(self, camera: str, images: int) -> None:
        """Note images that were sent and never came."""
        with self._lock:
            self._lost[camera] += images

    def failed(self, message: str) -> bool:
        """Note an error; returns whether it differs from the last one."""
        with self._lock:
            new = message != self._last_error
            self._last_error = message
            return new

    def restarted(self) -> None:
        """Forget the last result; the counts stay."""
        with self._lock:
            self._result = None

    def values(
        self, counts: SyncCounts, cameras: Sequence[str], missing: Sequence[str]
    ) -> dict[str, str]:
        """Everything as text, by key, in a fixed order.

        Args:
            counts: what became of the sets of images.
            cameras: names, in order.
            missing: topics or cameras that are waited for.
        """
        with self._lock:
            result = self._result
            latencies = np.array(self._latencies_s) * 1e3
            values = {
                "ready": "true" if self._ready else "false",
                "state": (TrackState.SEARCHING if result is None else result.state).value,
                "activity": self._activity,
                "tracked": str(self._tracked),
                "skipped": str(counts.skipped if self._ready else 0),
                "incomplete": str(counts.incomplete),
                "restarts": str(counts.restarts),
                "dropped_before_ready": str(
                    self._dropped["before_ready"] if self._ready else counts.complete
                ),
                "dropped_before_start": str(self._dropped["before_start"]),
                "dropped_while_learning": str(self._dropped["while_learning"]),
                "dropped_on_error": str(self._dropped["error"]),
                "latency_median_ms": _number(np.median(latencies) if latencies.size else None, 1),
                "latency_p95_ms": _number(
                    np.percentile(latencies, 95) if latencies.size else None, 1
                ),
                "fps": _number(self._rate(), 2),
                "stamp_ns": "" if result is None else str(result.stamp_ns),
                "fitness": _number(None if result is None else result.fitness, 4),
                "evaluations": "0" if result is None else str(result.evaluations),
            }
            iou: Mapping[str, float] = {} if result is None else result.iou
            for name in cameras:
                values[f"iou/{name}"] = _number(iou.get(name), 4)
            exposure: Mapping[str, tuple[float, ...]] = {} if result is None else result.exposure
            for name in cameras:
                gain = float(np.mean(exposure[name])) if name in exposure else None
                values[f"exposure/{name}"] = _number(gain, 3)
            limbs: Mapping[str, LimbState] = {} if result is None else result.limbs
            lost = [name for name, limb in limbs.items() if limb.state is TrackState.LOST]
            values["lost_limbs"] = ", ".join(lost)
            for name in cameras:
                values[f"refused/{name}"] = str(self._refused[name])
            for name in cameras:
                values[f"lost/{name}"] = str(self._lost[name])
            values["missing"] = ", ".join(missing)
            values["warnings"] = "" if result is None else "; ".join(result.warnings)
            values["last_error"] = self._last_error
            return values

    def _rate(self) -> float | None:
        if len(self._finished_s) < 2:
            return None
        span = self._finished_s[-1] - self._finished_s[0]
        return (len(self._finished_s) - 1) / span if span > 0.0 else None


def _number(value: float | None, digits: int) -> str:
    return "nan" if value is None or not np.isfinite(value) else f"{value:.{digits}f}"
