"""Counts, times and errors of a running tracker, for its diagnostics."""

import time
from collections import Counter, deque
from collections.abc import Callable, Mapping, Sequence
from threading import Lock
from types import MappingProxyType

import numpy as np

from markerless_tracker.calibration.contours.time_offset import TimeOffset
from markerless_tracker.node.tracker.cameras.counts import CameraCounts, SyncCounts
from markerless_tracker.records import LimbState, TrackResult, TrackState

WINDOW = 300
"""Number of frames over which latency and rate are computed."""
RATE_S = 5.0
"""Time over which the rate of a running stream is computed."""

NOTED = (
    "tracked",
    "skipped",
    "incomplete",
    "late",
    "duplicates",
    "restarts",
    "dropped_before_ready",
    "dropped_before_start",
    "dropped_while_learning",
    "dropped_on_error",
    "dropped_at_end",
    "latency_median_ms",
    "latency_p95_ms",
    "fps",
    "first_pose_s",
    "cpu_s",
)
"""Keys of the values that a result file records."""


class TrackerStatus:
    """Counts, times and errors since the start. Safe to use from several threads."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._ready = False
        self._ready_s: float | None = None
        self._activity = "starting"
        self._tracked = 0
        self._dropped: Counter[str] = Counter()
        self._refused: Counter[str] = Counter()
        self._lost: Counter[str] = Counter()
        self._latencies_s: deque[float] = deque(maxlen=WINDOW)
        self._finished_s: deque[float] = deque(maxlen=WINDOW)
        self._result: TrackResult | None = None
        self._last_error = ""
        self._last_set_error = ""
        self._dealt_ns: int | None = None
        self._first_arrived_s: float | None = None
        self._first_pose_s: float | None = None
        self._ready_cpu_s = 0.0
        self._helper_cpu_s: Callable[[], float] = lambda: 0.0

    @property
    def ready(self) -> bool:
        """Whether the kernels are compiled and images are tracked on arrival."""
        with self._lock:
            return self._ready

    @property
    def tracked_sets(self) -> int:
        """Number of sets that were tracked."""
        with self._lock:
            return self._tracked

    @property
    def stamp_ns(self) -> int:
        """Stamp of the last result; 0 before the first."""
        with self._lock:
            return 0 if self._result is None else self._result.stamp_ns

    @property
    def state(self) -> TrackState:
        """State after the last result; SEARCHING before the first."""
        with self._lock:
            return TrackState.SEARCHING if self._result is None else self._result.state

    @property
    def activity(self) -> str:
        """Present activity of the tracker, in a few words."""
        with self._lock:
            return self._activity

    def doing(self, activity: str) -> None:
        """Set the activity."""
        with self._lock:
            self._activity = activity

    def add_cpu_of(self, helper_cpu_s: Callable[[], float]) -> None:
        """Include the CPU time of a helper process."""
        with self._lock:
            self._helper_cpu_s = helper_cpu_s

    def became_ready(self, activity: str, *, now_s: float) -> None:
        """Note that images are tracked on arrival from now on."""
        with self._lock:
            self._activity, self._ready, self._ready_s = activity, True, now_s
            self._ready_cpu_s = self._cpu_s()
            self._refused.clear()
            self._lost.clear()

    def tracked(self, result: TrackResult, *, arrived_s: float, finished_s: float) -> None:
        """Record a result and its times, of one monotonic clock."""
        with self._lock:
            self._tracked += 1
            self._result = result
            self._last_set_error = ""
            self._finished_s.append(finished_s)
            if self._first_arrived_s is None:
                self._first_arrived_s = arrived_s
            if self._first_pose_s is None and result.pose is not None:
                self._first_pose_s = finished_s - self._first_arrived_s

    def published(self, latency_s: float) -> None:
        """Record that a result was published so long after its set's last image had come."""
        with self._lock:
            self._latencies_s.append(latency_s)

    def dealt_with(self, stamp_ns: int) -> None:
        """Record that a complete set was tracked or dropped."""
        with self._lock:
            self._dealt_ns = stamp_ns

    def dropped(self, reason: str, sets: int = 1) -> None:
        """Count complete sets that were not tracked, by reason such as ``before_ready``."""
        with self._lock:
            self._dropped[reason] += sets

    def refused(self, camera: str) -> None:
        """Count an unusable image."""
        with self._lock:
            self._refused[camera] += 1

    def lost(self, camera: str, images: int) -> None:
        """Count images that were sent and not received."""
        with self._lock:
            self._lost[camera] += images

    def failed(self, message: str) -> None:
        """Record an error."""
        with self._lock:
            self._last_error = message

    def record_failed_set(self, message: str) -> None:
        """Record a set that could not be tracked."""
        with self._lock:
            self._dropped["error"] += 1
            self._last_error = self._last_set_error = message

    def last_set_error(self) -> str:
        """Reason why the last set could not be tracked; empty if it was tracked."""
        with self._lock:
            return self._last_set_error

    def finished_s(self) -> float | None:
        """Time of the last result; None before the first."""
        with self._lock:
            return self._finished_s[-1] if self._finished_s else None

    def became_ready_s(self) -> float | None:
        """Time at which the tracker became ready; None before."""
        with self._lock:
            return self._ready_s

    def restarted(self) -> None:
        """Forget the last result; the counts are kept."""
        with self._lock:
            self._result = None

    def values(
        self,
        counts: SyncCounts,
        cameras: Sequence[str],
        missing: Sequence[str],
        *,
        now_s: float | None = None,
        views: Mapping[str, CameraCounts] = MappingProxyType({}),
        time_offsets: Mapping[str, TimeOffset] = MappingProxyType({}),
    ) -> dict[str, str]:
        """Everything as text, by key, in a fixed order.

        `first_pose_s`: from the arrival of the first set that was tracked to the first pose;
        `cpu_s`: CPU time since it became ready; `dealt_with_ns`: stamp of the last
        complete set that was tracked or dropped.

        Args:
            counts: of the sets of images.
            cameras: names, in order.
            missing: topics or transforms that are missing.
            now_s: the time, for `fps` over the last `RATE_S`; None = over the last `WINDOW` frames.
            views: counts of the cameras' views; other cameras have no entries.
            time_offsets: of the cameras, estimated from the motion, by name, as far as known.
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
                "late": str(counts.late),
                "duplicates": str(counts.duplicates),
                "restarts": str(counts.restarts),
                "dropped_before_ready": str(
                    self._dropped["before_ready"] if self._ready else counts.complete
                ),
                "dropped_before_start": str(self._dropped["before_start"]),
                "dropped_while_learning": str(self._dropped["while_learning"]),
                "dropped_on_error": str(self._dropped["error"]),
                "dropped_at_end": str(self._dropped["at_end"]),
                "latency_median_ms": _number(np.median(latencies) if latencies.size else None, 1),
                "latency_p95_ms": _number(
                    np.percentile(latencies, 95) if latencies.size else None, 1
                ),
                "fps": _number(self._rate(now_s), 2),
                "first_pose_s": _number(self._first_pose_s, 3),
                "cpu_s": _number(self._cpu_s() - self._ready_cpu_s if self._ready else None, 3),
                "stamp_ns": "" if result is None else str(result.stamp_ns),
                "dealt_with_ns": "" if self._dealt_ns is None else str(self._dealt_ns),
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
            for name, count in views.items():
                for what in ("received", "matched", "late", "dropped"):
                    values[f"{what}/{name}"] = str(getattr(count, what))
                values[f"offset_ms/{name}"] = _number(count.offset_ms, 3)
                late = time_offsets.get(name)
                values[f"late_ms/{name}"] = _number(
                    None if late is None else 1e3 * late.offset_s, 1
                )
                values[f"late_sd_ms/{name}"] = _number(None if late is None else 1e3 * late.sd_s, 1)
            values["missing"] = ", ".join(missing)
            values["warnings"] = "" if result is None else "; ".join(result.warnings)
            values["last_error"] = self._last_error
            return values

    def _cpu_s(self) -> float:
        return time.process_time() + self._helper_cpu_s()

    def _rate(self, now_s: float | None) -> float | None:
        if not self._finished_s:
            return None
        times = [t for t in self._finished_s if now_s is None or now_s - t <= RATE_S]
        if not times:
            return 0.0
        # In a running stream the time since the last frame counts, so the rate falls without
        # frames.
        span = (times[-1] if now_s is None else now_s) - times[0]
        return (len(times) - 1) / span if span > 0.0 else None


def _number(value: float | None, digits: int) -> str:
    return "nan" if value is None or not np.isfinite(value) else f"{value:.{digits}f}"
