"""Decides the effort for each set when sets come faster than they are tracked."""

from collections import deque
from dataclasses import dataclass

LEAST = 0.5
"""Least effort: fewer searches would cost much accuracy and save little time."""
LATE_SETS = 2
"""Number of late sets among the last `WINDOW` at which the effort falls: one long search is no
overload."""
OLD_S = 0.15
"""Age of a set at which the effort falls at once: a start's first search has just ended, and what
follows must not take as long."""
WINDOW = 12
EARLY_SETS = 12
"""Number of consecutive sets with time to spare before the effort rises."""
SPARE = 0.2
"""Least fraction of the time between two sets that counts as time to spare."""
_RISE = 1.15


@dataclass(frozen=True)
class Lateness:
    """Lateness of the worker when it takes a set.

    Attributes:
        left_out: number of complete sets replaced by newer ones since the worker took its last set.
        waited_s: time that the worker waited for the set; 0 if it was ready.
        age_s: time since the set was complete.
        period_s: time from the completion of the set before to that of this set.
    """

    left_out: int
    waited_s: float
    age_s: float
    period_s: float

    @property
    def late(self) -> bool:
        """Whether sets were left out, or this set waited for longer than the time between sets."""
        return self.left_out > 0 or self.age_s > self.period_s > 0.0

    @property
    def early(self) -> bool:
        """Whether there was time to spare."""
        return not self.late and self.waited_s > SPARE * self.period_s


class EffortRule:
    """The effort for the next set, in (0, 1].

    It falls to `LEAST` when `LATE_SETS` of the last `WINDOW` sets were late or one was older than
    `OLD_S`, since longer times between the sets make each of them costlier. It rises again while
    there is time to spare. In between it does not change, so that it does not oscillate.
    """

    def __init__(self) -> None:
        self._effort = 1.0
        self._recent: deque[bool] = deque(maxlen=WINDOW)
        self._early = 0

    @property
    def effort(self) -> float:
        """The effort for the last set that was taken."""
        return self._effort

    def take(self, lateness: Lateness) -> float:
        """The effort for a set that is taken now."""
        self._recent.append(lateness.late)
        self._early = self._early + 1 if lateness.early else 0
        if sum(self._recent) >= LATE_SETS or lateness.age_s > OLD_S:
            self._effort = LEAST
            self._recent.clear()
        elif self._early >= EARLY_SETS:
            self._effort, self._early = min(1.0, _RISE * self._effort), 0
        return self._effort
