"""Matches the cameras' images by their stamps, and returns the newest complete set."""

from collections import Counter, deque
from collections.abc import Iterable, Mapping, Sequence
from statistics import median_low
from threading import Condition
from typing import Generic, NamedTuple, TypeVar

from markerless_tracker.errors import ConfigError
from markerless_tracker.node.tracker.cameras.counts import (
    CameraCounter,
    CameraCounts,
    SyncCounts,
)
from markerless_tracker.node.tracker.pace.waiting import MatchedSet, WaitingSets

View = TypeVar("View")

STOPPED_VIEWS = 12
"""A silent camera is left out after another camera has sent this many views."""
STOPPED_S = 0.5
"""Least silence after which a camera that has sent views is left out."""
ABSENT_S = 5.0
"""Time after the very first view after which a camera that has sent none is left out: the discovery
of a publisher may take 3 s."""
LEAST_CAMERAS = 2
RESTART_SETS = 3
"""Number of consecutive sets, in order, older than the newest set, after which time is taken to
have been set back. Fewer such sets are late."""


class _Entry(NamedTuple, Generic[View]):
    stamp_ns: int
    view: View


class Synchronizer(Generic[View]):
    """Collects views as they arrive and returns the newest complete set.

    Each camera's views are kept in the order of arrival. The middleware preserves each camera's
    order, so when a set is complete, earlier views can never be completed and are dropped. Views
    are matched by equal stamps, not by their age, so a stamp far in the future cannot block the
    next sets. At most one complete set waits (more while sets are kept, see `keep`), and at most
    `depth` views per camera, however slow the consumer is.

    A set that is not newer than the last one is late and is dropped. After `RESTART_SETS` such sets
    in a row, in order, time is taken to have been set back, and sets are returned from there on.

    A camera that stops sending is left out when another camera has sent `STOPPED_VIEWS` views
    since, over at least `STOPPED_S`. A camera that has never sent is left out after `ABSENT_S`.
    Sets are then complete without it, as long as `LEAST_CAMERAS` remain. Its next view includes it
    again.

    Safe to use from several threads; no callback is ever called.

    Args:
        cameras: names, distinct.
        tolerance_ns: largest difference between the stamps of one set; 0 means equal stamps. More
            than half the time between two images would mix sets.
        depth: views kept per camera while views of the others are missing.

    Raises:
        ConfigError: no cameras, two of one name, or impossible numbers.
    """

    def __init__(self, cameras: Sequence[str], *, tolerance_ns: int = 0, depth: int = 24) -> None:
        if not cameras or len(set(cameras)) != len(cameras):
            raise ConfigError(f"cameras: got {list(cameras)}, expected at least one, distinct")
        if tolerance_ns < 0 or depth < 1:
            raise ConfigError(
                f"sync_tolerance: got {tolerance_ns} ns and a depth of {depth}, expected at least "
                "0 and 1"
            )
        self.cameras = tuple(cameras)
        self._tolerance_ns = tolerance_ns
        self._depth = depth
        self._pending: dict[str, deque[_Entry[View]]] = {name: deque() for name in cameras}
        self._last_stamps: dict[str, int] = {}
        self._last_view_s: dict[str, float] = {}
        self._first_s: float | None = None
        self._since: dict[str, Counter[str]] = {name: Counter() for name in cameras}
        self._waiting: WaitingSets[View] = WaitingSets()
        self._newest_ns: int | None = None
        self._late_ns: list[int] = []
        self._last_late_ns: int | None = None
        self._complete_s: float | None = None
        self._counts: Counter[str] = Counter()
        self._counter = CameraCounter(cameras)
        self._changed = Condition()

    @property
    def counts(self) -> SyncCounts:
        """Counts since the start, or since `start_counting`."""
        with self._changed:
            return SyncCounts(**self._counts)

    @property
    def camera_counts(self) -> dict[str, CameraCounts]:
        """Counts of each camera's views since the start, or since `start_counting`."""
        with self._changed:
            return self._counter.counts()

    @property
    def held(self) -> int:
        """Number of views kept now."""
        with self._changed:
            return self._waiting.views + sum(map(len, self._pending.values()))

    @property
    def late_ns(self) -> int | None:
        """Stamp of the last set that was dropped because it was late; None if there was none."""
        with self._changed:
            return self._last_late_ns

    @property
    def complete_s(self) -> float | None:
        """Time at which the last set became complete, late or not; None before the first."""
        with self._changed:
            return self._complete_s

    def add(self, camera: str, stamp_ns: int, view: View, *, now_s: float) -> bool:
        """Store one view; never blocks and does not process it.

        Args:
            camera: its name, one of `cameras`.
            stamp_ns: its time of capture.
            view: the object to return in a set.
            now_s: time of its arrival in s, of a monotonic clock.

        Returns:
            Whether it completed a set.
        """
        with self._changed:
            if self._first_s is None:
                self._first_s = now_s
            self._counter.note("received", camera)
            if self._last_stamps.get(camera) == stamp_ns:
                self._counts["duplicates"] += 1
                self._counter.note("dropped", camera)
                return False
            self._last_stamps[camera] = stamp_ns
            self._last_view_s[camera] = now_s
            self._since[camera].clear()
            for name in self.cameras:
                if name != camera:
                    self._since[name][camera] += 1
            self._pending[camera].append(_Entry(stamp_ns, view))
            positions = self._match(camera, stamp_ns, self._left_out(now_s))
            if positions is None:
                if len(self._pending[camera]) > self._depth:
                    self._drop_oldest(camera)
                return False
            self._complete(positions, now_s)
            self._changed.notify_all()
            return True

    def take(self, timeout_s: float = 0.0) -> MatchedSet[View] | None:
        """Remove and return the newest complete set, or the earliest kept set.

        Waits up to `timeout_s` for a set; None if none came.
        """
        with self._changed:
            if not self._waiting and timeout_s > 0.0:
                self._changed.wait(timeout_s)
            return self._waiting.take()

    def keep(self, at_most: int, *, followed: bool = False) -> None:
        """Keep at most `at_most` complete sets from now on; as `WaitingSets.keep`."""
        with self._changed:
            self._waiting.keep(at_most, followed=followed)

    def drop_older(self) -> None:
        """Drop all waiting complete sets but the newest."""
        with self._changed:
            self._counts["skipped"] += self._waiting.drop_older()

    def drop_all(self) -> int:
        """Drop all waiting complete sets; returns their number, which counts nowhere."""
        with self._changed:
            dropped = len(self._waiting)
            self._waiting.clear()
            return dropped

    def wake(self) -> None:
        """Make a waiting `take` return."""
        with self._changed:
            self._changed.notify_all()

    def silent(self, now_s: float, after_s: float = 1.0) -> tuple[str, ...]:
        """Cameras without a new view for `after_s`, or without any, in the order of the cameras."""
        with self._changed:
            return tuple(
                name
                for name in self.cameras
                if name not in self._last_view_s or now_s - self._last_view_s[name] > after_s
            )

    def left_out(self, now_s: float) -> tuple[str, ...]:
        """Cameras that are left out of the sets now, in the order of the cameras."""
        with self._changed:
            left_out = self._left_out(now_s)
            return tuple(name for name in self.cameras if name in left_out)

    def offsets_ns(self) -> dict[str, int]:
        """Offset of each camera's stamps from the nearest stamps of the other cameras.

        It is the median over the views that wait for their set, relative to the camera that agrees
        best with the others; cameras without such views are absent.
        """
        with self._changed:
            stamps = {name: [e.stamp_ns for e in queue] for name, queue in self._pending.items()}
        stamps = {name: queue for name, queue in stamps.items() if queue}
        candidates = [
            {name: _median_offset(queue, reference) for name, queue in stamps.items()}
            for reference in stamps.values()
        ]
        return min(candidates, key=lambda offsets: sum(map(abs, offsets.values())), default={})

    def start_counting(self) -> SyncCounts:
        """Discard the waiting set and reset all counts; returns the counts before.

        Views of incomplete sets are kept.
        """
        with self._changed:
            counts = SyncCounts(**self._counts)
            self._counts.clear()
            self._counter.reset()
            for name, queue in self._pending.items():
                self._counter.note("received", name, len(queue))
            self._waiting.clear()
            return counts

    def _left_out(self, now_s: float) -> frozenset[str]:
        left_out = frozenset(
            name
            for name, since in self._since.items()
            if max(since.values(), default=0) >= STOPPED_VIEWS and self._gone(name, now_s)
        )
        return left_out if len(self.cameras) - len(left_out) >= LEAST_CAMERAS else frozenset()

    def _gone(self, camera: str, now_s: float) -> bool:
        last_view_s = self._last_view_s.get(camera)
        if last_view_s is not None:
            return now_s - last_view_s >= STOPPED_S
        return self._first_s is not None and now_s - self._first_s >= ABSENT_S

    def _match(self, camera: str, stamp_ns: int, left_out: frozenset[str]) -> dict[str, int] | None:
        """Positions of a set's views in the cameras' queues, if the given view completes a set."""
        positions: dict[str, int] = {}
        for name, queue in self._pending.items():
            if name in left_out:
                continue
            if name == camera:
                positions[name] = len(queue) - 1
                continue
            found = _nearest(queue, stamp_ns, self._tolerance_ns)
            if found is None:
                return None
            positions[name] = found
        stamps = [self._pending[name][at].stamp_ns for name, at in positions.items()]
        return positions if max(stamps) - min(stamps) <= self._tolerance_ns else None

    def _complete(self, positions: Mapping[str, int], now_s: float) -> None:
        members: dict[str, _Entry[View]] = {}
        for name in self.cameras:
            if name not in positions:
                continue
            for _ in range(positions[name]):
                self._drop_oldest(name)
            members[name] = self._pending[name].popleft()
        period_s = 0.0 if self._complete_s is None else now_s - self._complete_s
        self._complete_s = now_s
        stamps = {name: entry.stamp_ns for name, entry in members.items()}
        stamp_ns = min(stamps.values())
        accepted = self._accepts(stamp_ns)
        self._counter.complete(stamps, late=not accepted)
        if not accepted:
            self._counts["late"] += 1
            self._last_late_ns = stamp_ns
            return
        restarted = self._newest_ns is not None and stamp_ns <= self._newest_ns
        if restarted:
            self._counts["restarts"] += 1
        self._counts["complete"] += 1
        self._newest_ns = stamp_ns
        views = {name: entry.view for name, entry in members.items()}
        matched = MatchedSet(stamp_ns, views, now_s, restarted, period_s=period_s)
        self._counts["skipped"] += self._waiting.put(matched)

    def _accepts(self, stamp_ns: int) -> bool:
        """Whether a set is newer than the last one, or time was set back."""
        if self._newest_ns is None or stamp_ns > self._newest_ns:
            self._late_ns.clear()
            return True
        if self._late_ns and stamp_ns <= self._late_ns[-1]:
            self._late_ns.clear()
        self._late_ns.append(stamp_ns)
        if len(self._late_ns) < RESTART_SETS:
            return False
        self._late_ns.clear()
        return True

    def _drop_oldest(self, camera: str) -> None:
        """Drop a camera's oldest view; the set is incomplete once its last view is dropped."""
        stamp_ns = self._pending[camera].popleft().stamp_ns
        self._counter.note("dropped", camera)
        others = (queue for name, queue in self._pending.items() if name != camera)
        if not any(_nearest(queue, stamp_ns, self._tolerance_ns) is not None for queue in others):
            self._counts["incomplete"] += 1


def _nearest(queue: Iterable[_Entry[View]], stamp_ns: int, tolerance_ns: int) -> int | None:
    """Position of the view with the nearest stamp, the last of equals; None if none is near."""
    best: int | None = None
    best_gap = tolerance_ns
    for position, entry in enumerate(queue):
        gap = abs(entry.stamp_ns - stamp_ns)
        if gap <= best_gap:
            best, best_gap = position, gap
    return best


def _median_offset(stamps_ns: Sequence[int], reference_ns: Sequence[int]) -> int:
    """Median over stamps of the signed distance to the nearest reference stamp."""
    return median_low(
        min((stamp - other for other in reference_ns), key=abs) for stamp in stamps_ns
    )
