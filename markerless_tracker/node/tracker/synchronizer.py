"""Matching the cameras' images by their stamps; the newest complete set wins."""

from collections import Counter, deque
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from threading import Condition
from typing import Generic, NamedTuple, TypeVar

from markerless_tracker.errors import ConfigError

View = TypeVar("View")


STOPPED_VIEWS = 12
STOPPED_S = 0.5
LEAST_CAMERAS = 2


class _Entry(NamedTuple, Generic[View]):
    stamp_ns: int
    view: View


@dataclass(frozen=True)
class MatchedSet(Generic[View]):
    """One view of every camera that sends.

    Attributes:
        stamp_ns: the earliest of their stamps.
        views: by camera, in the order of the cameras.
        arrived_s: when the last of them came, in the caller's clock.
        restarted: its stamp lies before that of a set handed out earlier (a bag began anew).
    """

    stamp_ns: int
    views: Mapping[str, View]
    arrived_s: float
    restarted: bool


@dataclass(frozen=True)
class SyncCounts:
    """What became of the sets so far.

    Attributes:
        complete: sets of which every camera's view came.
        skipped: complete sets that a newer one replaced before they were taken.
        incomplete: sets given up because a view of them never came.
        restarts: times that the sets' stamps went backwards.
    """

    complete: int = 0
    skipped: int = 0
    incomplete: int = 0
    restarts: int = 0


class Synchronizer(Generic[View]):
    """Collects views as they arrive and hands out the newest set that is complete.

    Each camera's views are kept in the order they arrived. The middleware keeps each camera's
    order, so once a set is complete, whatever arrived before its members can never be completed
    and is let go; stamps are compared for being equal, never for being old. A bag that begins
    anew, or one stamp far in the future, therefore cannot block it. Nothing queues up behind a
    slow consumer: at most one complete set waits, and at most `depth` views per camera.

    A camera that stops after it was heard is waited for no longer once another has sent
    `STOPPED_VIEWS` views since, over `STOPPED_S` at least: sets are then complete without it, as
    long as `LEAST_CAMERAS` are left. Its next view takes it back.

    Safe to use from several threads; no callback is ever called.

    Args:
        cameras: names, distinct.
        tolerance_ns: how far the stamps of one set may lie apart; 0 means equal stamps. More than
            half the time between two images would mix sets.
        depth: views kept per camera while the others' are on their way.

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
        self._heard_s: dict[str, float] = {}
        self._since: dict[str, Counter[str]] = {name: Counter() for name in cameras}
        self._waiting: MatchedSet[View] | None = None
        self._last_ns: int | None = None
        self._counts = {"complete": 0, "skipped": 0, "incomplete": 0, "restarts": 0}
        self._changed = Condition()

    @property
    def counts(self) -> SyncCounts:
        """What became of the sets so far."""
        with self._changed:
            return SyncCounts(**self._counts)

    @property
    def held(self) -> int:
        """Views kept at this moment."""
        with self._changed:
            waiting = len(self._waiting.views) if self._waiting is not None else 0
            return waiting + sum(len(queue) for queue in self._pending.values())

    def add(self, camera: str, stamp_ns: int, view: View, *, now_s: float) -> bool:
        """Store one view; never blocks and does no work on it.

        Args:
            camera: its name, one of `cameras`.
            stamp_ns: its time of capture.
            view: whatever is to be handed out again.
            now_s: the time of its arrival, in any clock that only goes forward.

        Returns:
            Whether it completed a set.
        """
        with self._changed:
            self._heard_s[camera] = now_s
            self._since[camera].clear()
            for name in self.cameras:
                if name != camera:
                    self._since[name][camera] += 1
            self._pending[camera].append(_Entry(stamp_ns, view))
            positions = self._match(camera, stamp_ns, self._stopped(now_s))
            if positions is None:
                if len(self._pending[camera]) > self._depth:
                    self._give_up(camera)
                return False
            self._complete(positions, now_s)
            self._changed.notify_all()
            return True

    def take(self, timeout_s: float = 0.0) -> MatchedSet[View] | None:
        """The newest complete set, once; waits up to `timeout_s` for one, None if none came."""
        with self._changed:
            if self._waiting is None and timeout_s > 0.0:
                self._changed.wait(timeout_s)
            taken, self._waiting = self._waiting, None
            if taken is not None:
                self._last_ns = taken.stamp_ns
            return taken

    def wake(self) -> None:
        """Let a waiting `take` return at once."""
        with self._changed:
            self._changed.notify_all()

    def silent(self, now_s: float, after_s: float = 1.0) -> tuple[str, ...]:
        """Cameras of which nothing came for that long, or ever, in the order of the cameras."""
        with self._changed:
            return tuple(
                name
                for name in self.cameras
                if name not in self._heard_s or now_s - self._heard_s[name] > after_s
            )

    def start_counting(self) -> SyncCounts:
        """Forget the waiting set and begin all counts anew; returns what they were.

        Views of sets not yet complete stay: they complete the first set of the new count.
        """
        with self._changed:
            counts = SyncCounts(**self._counts)
            self._counts = dict.fromkeys(self._counts, 0)
            self._waiting = None
            return counts

    def _stopped(self, now_s: float) -> frozenset[str]:
        """Cameras that are waited for no longer."""
        stopped = frozenset(
            name
            for name, since in self._since.items()
            if name in self._heard_s
            and now_s - self._heard_s[name] >= STOPPED_S
            and max(since.values(), default=0) >= STOPPED_VIEWS
        )
        return stopped if len(self.cameras) - len(stopped) >= LEAST_CAMERAS else frozenset()

    def _match(self, camera: str, stamp_ns: int, stopped: frozenset[str]) -> dict[str, int] | None:
        """Positions of a set's members in the cameras' queues, if that view completes one."""
        positions: dict[str, int] = {}
        for name, queue in self._pending.items():
            if name in stopped:
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
                self._give_up(name)
            members[name] = self._pending[name].popleft()
        stamp_ns = min(entry.stamp_ns for entry in members.values())
        newest_ns = self._last_ns
        restarted = False
        if self._waiting is not None:
            self._counts["skipped"] += 1
            newest_ns, restarted = self._waiting.stamp_ns, self._waiting.restarted
        if newest_ns is not None and stamp_ns < newest_ns:
            self._counts["restarts"] += 1
            restarted = True
        self._counts["complete"] += 1
        views = {name: entry.view for name, entry in members.items()}
        self._waiting = MatchedSet(stamp_ns, views, now_s, restarted)

    def _give_up(self, camera: str) -> None:
        """Drop a camera's oldest view; the last view of a set to go counts it as incomplete."""
        stamp_ns = self._pending[camera].popleft().stamp_ns
        others = (queue for name, queue in self._pending.items() if name != camera)
        if not any(_nearest(queue, stamp_ns, self._tolerance_ns) is not None for queue in others):
            self._counts["incomplete"] += 1


def _nearest(queue: Iterable[_Entry[View]], stamp_ns: int, tolerance_ns: int) -> int | None:
    """Position of the view nearest in stamp, the last of equals; None if none is near enough."""
    best: int | None = None
    best_gap = tolerance_ns
    for position, entry in enumerate(queue):
        gap = abs(entry.stamp_ns - stamp_ns)
        if gap <= best_gap:
            best, best_gap = position, gap
    return best
