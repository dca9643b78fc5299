"""A histogram for medians and quantiles of a run, in constant memory."""

import math

import numpy as np


class Histogram:
    """Counts numbers in bins of equal width; those beyond an end count in its bin.

    Args:
        low: lower end of the first bin.
        high: upper end of the last bin.
        bins: number of bins.

    Attributes:
        count: numbers added; NaN is left out.
    """

    def __init__(self, low: float, high: float, bins: int) -> None:
        self._low, self._width = low, (high - low) / bins
        self._counts = np.zeros(bins, dtype=np.int64)
        self.count = 0

    def add(self, value: float) -> None:
        """Count a number."""
        if math.isnan(value):
            return
        place = math.floor((min(max(value, -1e9), 1e9) - self._low) / self._width)
        self._counts[min(max(place, 0), len(self._counts) - 1)] += 1
        self.count += 1

    @property
    def median(self) -> float:
        """The median, as the middle of its bin; NaN if there is no number."""
        return self.quantile(0.5)

    def quantile(self, fraction: float) -> float:
        """The quantile at a fraction, as the middle of its bin; NaN if there is no number."""
        if not self.count:
            return math.nan
        place = int(np.searchsorted(np.cumsum(self._counts), fraction * self.count))
        return self._low + (place + 0.5) * self._width
