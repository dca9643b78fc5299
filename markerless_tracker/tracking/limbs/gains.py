"""Sum of the gains of another pose over several comparisons."""

FORGETTING = 0.9
"""Factor of the earlier sum in each comparison."""


class GainSum:
    """A cumulative sum of gains that is never negative (CUSUM), and forgets.

    A comparison in which the other pose fits worse lowers the sum, so that a few frames do not
    decide.

    Attributes:
        total: the sum.
        count: number of comparisons since it was last 0.
    """

    def __init__(self) -> None:
        self.total = 0.0
        self.count = 0

    @property
    def mean(self) -> float:
        """Sum per comparison; 0 without one."""
        return self.total / max(1, self.count)

    def add(self, gain: float) -> None:
        """Add the gain of a comparison."""
        self.total = max(0.0, FORGETTING * self.total + gain)
        self.count = self.count + 1 if self.total > 0.0 else 0
