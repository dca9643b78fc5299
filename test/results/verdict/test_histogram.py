import math

import numpy as np

from markerless_tracker.results.verdict.histogram import Histogram


def test_the_median_within_half_a_bin() -> None:
    rng = np.random.default_rng(1)
    values = rng.beta(8.0, 2.0, 999)
    histogram = Histogram(0.0, 1.0, 200)
    for value in values.tolist():
        histogram.add(value)
    histogram.add(math.nan)
    assert histogram.count == 999
    assert abs(histogram.median - np.median(values)) <= 0.0026


def test_values_beyond_the_ends_count_in_the_last_bins() -> None:
    histogram = Histogram(-1.0, 1.0, 10)
    assert math.isnan(histogram.median)
    for value in (5.0, math.inf, 1e300, -math.inf, 1.0):
        histogram.add(value)
    assert histogram.count == 5 and abs(histogram.median - 0.9) < 1e-9


def test_quantiles() -> None:
    found = Histogram(0.0, 10.0, 100)
    for value in range(100):
        found.add(0.1 * value + 0.05)
    assert abs(found.quantile(0.25) - 2.5) < 0.11
    assert found.quantile(0.5) == found.median
    assert math.isnan(Histogram(0.0, 1.0, 10).quantile(0.25))
