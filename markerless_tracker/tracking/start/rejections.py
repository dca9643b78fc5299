"""Rejected hulls, whose search found no person: they are searched again at growing intervals.

A search takes as long as many tracked frames. Without this, an object that entered the scene after
its background was learned would cost a search in every set.
"""

from dataclasses import dataclass, replace

import numpy as np

from markerless_tracker.geometry import FloatArray
from markerless_tracker.tracking.evidence.grid import FINE_M
from markerless_tracker.tracking.evidence.hull import Hull

FIRST_WAIT = 2
"""Frames without a search after the first rejection; doubled by each further one."""
LONGEST_WAIT_NS = 1_000_000_000
"""After this time a hull is searched again, however often it was rejected."""
MOVED_M = 0.30
"""A hull whose middle or top moved farther than this counts as a new hull."""
RESIZED = 0.30
"""A hull whose volume changed by a larger fraction counts as a new hull, too."""
FORGOTTEN_NS = 5_000_000_000
"""A hull that was not seen for this time is forgotten."""


@dataclass(frozen=True, eq=False)
class _Rejected:
    middle_m: FloatArray
    high_m: float
    volume_m3: float
    wait: int
    frame: int
    searched_ns: int
    seen_ns: int

    @classmethod
    def of(cls, hull: Hull, wait: int, frame: int, stamp_ns: int) -> "_Rejected":
        return cls(
            hull.points_m.mean(axis=0), hull.high_m, _volume_m3(hull), wait, frame,
            stamp_ns, stamp_ns,
        )  # fmt: skip

    def matches(self, hull: Hull) -> bool:
        moved_m = float(np.linalg.norm(hull.points_m.mean(axis=0) - self.middle_m))
        return (
            max(moved_m, abs(hull.high_m - self.high_m)) <= MOVED_M
            and abs(_volume_m3(hull) / self.volume_m3 - 1.0) <= RESIZED
        )


class Rejections:
    """Remembers rejected hulls, and when each may be searched again.

    A hull is the same as an earlier one if place and size are about the same. `begin_frame` counts
    the frames; if stamps run backwards, all hulls are forgotten.
    """

    def __init__(self) -> None:
        self._rejected: list[_Rejected] = []
        self._frame = 0
        self._stamp_ns = 0

    def begin_frame(self, stamp_ns: int) -> None:
        """Begin a frame at a time."""
        if stamp_ns < self._stamp_ns:
            self._rejected = []
        self._frame += 1
        self._stamp_ns = stamp_ns
        self._rejected = [r for r in self._rejected if stamp_ns - r.seen_ns <= FORGOTTEN_NS]

    def waits(self, hull: Hull) -> bool:
        """Whether a hull was rejected so recently that it is not searched in this frame."""
        known = self._known(hull)
        if known is None:
            return False
        index, last = known
        self._rejected[index] = replace(last, seen_ns=self._stamp_ns)
        return (
            self._frame - last.frame <= last.wait
            and self._stamp_ns - last.searched_ns < LONGEST_WAIT_NS
        )

    def rejected(self, hull: Hull) -> bool:
        """Whether a hull was found to be no person."""
        return self._known(hull) is not None

    def note(self, hull: Hull) -> None:
        """Note that a search of a hull in this frame found no person."""
        known = self._known(hull)
        wait = FIRST_WAIT
        if known is not None:
            wait = 2 * self._rejected.pop(known[0]).wait
        self._rejected.append(_Rejected.of(hull, wait, self._frame, self._stamp_ns))

    def _known(self, hull: Hull) -> tuple[int, _Rejected] | None:
        return next(((n, r) for n, r in enumerate(self._rejected) if r.matches(hull)), None)


def _volume_m3(hull: Hull) -> float:
    return FINE_M**3 * len(hull.points_m)
