"""Takes the next set and makes its evidence while the set before it is fitted."""

import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from threading import Event
from typing import Any

from markerless_tracker.node.tracker.pace.waiting import MatchedSet
from markerless_tracker.node.tracker.synchronizer import Synchronizer

_RECENT = 5
"""Number of the latest fits, and of evidence made ahead, whose durations determine the delay."""
_SPARE_S = 0.002


@dataclass(frozen=True)
class Taken:
    """A set that was taken, and the evidence made of it.

    Attributes:
        matched: the set.
        made: returned by `make`; None if it raised an error.
        error: raised by `make`.
    """

    matched: MatchedSet[Any]
    made: Any = None
    error: Exception | None = None


class Ahead:
    """Takes the newest set and makes its evidence, in a second thread during a fit.

    The set is taken as late as possible for its evidence to be ready when the fit ends, so that it
    is the newest one. If the fit takes longer, the set is fitted nevertheless: to make evidence of
    a newer set would delay the tracker further.

    Args:
        sets: source of the complete sets.
        make: called with a set in the second thread.
        poll_s: longest wait for a set.
        clock: monotonic time in s.
    """

    def __init__(
        self,
        sets: Synchronizer[Any],
        make: Callable[[MatchedSet[Any]], Any],
        *,
        poll_s: float,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._sets = sets
        self._make = make
        self._poll_s = poll_s
        self._clock = clock
        self._pool = ThreadPoolExecutor(1, thread_name_prefix="evidence")
        self._following: Future[Taken | None] | None = None
        self._fitted = Event()
        self._began_s = 0.0
        self._fits_s = deque([0.0], maxlen=_RECENT)
        self._makes_s = deque([0.0], maxlen=_RECENT)

    def next(self) -> Taken | None:
        """The set to fit now; None if no set came in time."""
        following, self._following = self._following, None
        return self._take(0.0) if following is None else following.result()

    def fitting(self) -> None:
        """Note that a fit begins; the next set's evidence is made during it."""
        self._fitted.clear()
        self._began_s = self._clock()
        # The shortest fit counts, so that a single long fit does not delay the sets after it.
        delay_s = max(0.0, min(self._fits_s) - max(self._makes_s) - _SPARE_S)
        self._following = self._pool.submit(self._take, delay_s)

    def fitted(self) -> None:
        """Note that the fit has ended."""
        self._fits_s.append(self._clock() - self._began_s)
        self._fitted.set()

    def close(self) -> int:
        """Stop taking sets; returns how many were taken that are not fitted, one at most."""
        self._fitted.set()
        self._sets.wake()
        self._pool.shutdown()
        following, self._following = self._following, None
        return int(following is not None and following.result() is not None)

    def _take(self, delay_s: float) -> Taken | None:
        if delay_s > 0.0:
            self._fitted.wait(delay_s)
        matched = self._sets.take(self._poll_s)
        if matched is None:
            return None
        began_s = self._clock()
        try:
            return Taken(matched, self._make(matched))
        except Exception as error:
            return Taken(matched, error=error)
        finally:
            self._makes_s.append(self._clock() - began_s)
