"""Counts of sets, and of each camera's views: received, matched, late, dropped; stamp offsets."""

from collections import Counter, deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import median

WINDOW = 61
"""Number of sets over which a camera's offset is the median."""


@dataclass(frozen=True)
class SyncCounts:
    """Counts of sets and views.

    Attributes:
        complete: sets with a view of every camera that is not left out, in order of time.
        skipped: complete sets that were replaced by a newer set before they were taken.
        incomplete: sets dropped because a view never came.
        late: complete sets dropped because a newer set was complete before.
        duplicates: views dropped because they repeat the stamp before.
        restarts: number of times that stamps ran backwards.
    """

    complete: int = 0
    skipped: int = 0
    incomplete: int = 0
    late: int = 0
    duplicates: int = 0
    restarts: int = 0


@dataclass(frozen=True)
class CameraCounts:
    """Counts of one camera's views; views that wait for others count as `received` only.

    Attributes:
        received: usable views, including repeated stamps.
        matched: views of complete sets that were not late.
        late: views of sets that were complete after a newer set.
        dropped: views whose set never became complete, and repeated stamps.
        offset_ms: median difference of its stamps from the median stamp of their sets; None before
            the first set.
    """

    received: int = 0
    matched: int = 0
    late: int = 0
    dropped: int = 0
    offset_ms: float | None = None


class CameraCounter:
    """Counts the views of each camera. Not safe to use from several threads.

    Args:
        cameras: their names.
    """

    def __init__(self, cameras: Sequence[str]) -> None:
        self._cameras = tuple(cameras)
        self.reset()

    def reset(self) -> None:
        """Restart the counts at 0, and forget the offsets."""
        self._counts: dict[str, Counter[str]] = {name: Counter() for name in self._cameras}
        self._offsets_ns: dict[str, deque[float]] = {
            name: deque(maxlen=WINDOW) for name in self._cameras
        }

    def note(self, what: str, camera: str, views: int = 1) -> None:
        """Count views of a camera as one of the attributes of `CameraCounts`."""
        self._counts[camera][what] += views

    def complete(self, stamps_ns: Mapping[str, int], *, late: bool) -> None:
        """Count the views of a complete set, by the stamps of its members."""
        middle_ns = median(stamps_ns.values())
        for name, stamp_ns in stamps_ns.items():
            self._counts[name]["late" if late else "matched"] += 1
            self._offsets_ns[name].append(stamp_ns - middle_ns)

    def counts(self) -> dict[str, CameraCounts]:
        """The counts by camera."""
        found = {}
        for name in self._cameras:
            offsets = self._offsets_ns[name]
            offset_ms = median(offsets) / 1e6 if offsets else None
            found[name] = CameraCounts(**self._counts[name], offset_ms=offset_ms)
        return found
