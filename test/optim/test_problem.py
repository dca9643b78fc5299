"""What a search may be set up with."""

import numpy as np
import pytest

from markerless_tracker.errors import SearchError
from markerless_tracker.optim import Problem, everything_feasible


def problem(**changes) -> Problem:
    settings = {
        "bounds": np.array([[-1.0, -1.0], [1.0, 1.0]]),
        "centre": np.zeros(2),
        "sigma": np.ones(2),
        "particles": 3,
        "iterations": 4,
        "feasible": everything_feasible,
        "rng": np.random.default_rng(0),
    }
    return Problem(**{**settings, **changes})


def test_free_bounds_and_still_parameters_are_fine():
    problem(bounds=np.array([[-np.inf, 0.0], [np.inf, 0.0]]), sigma=np.array([1.0, 0.0]))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"bounds": np.zeros((2, 3))}, r"bounds \(2, 3\) .* do not fit a centre of 2"),
        ({"sigma": np.ones(3)}, r"sigma \(3,\) do not fit a centre of 2"),
        ({"bounds": np.array([[1.0, 0.0], [0.0, 0.0]])}, "must not cross"),
        ({"sigma": np.array([1.0, -1e-9])}, "must not be negative"),
        ({"sigma": np.array([1.0, np.nan])}, "must not be negative"),
        ({"particles": 0}, "0 particles x 4 iterations"),
        ({"iterations": 0}, "3 particles x 0 iterations"),
    ],
)
def test_impossible_searches_are_refused(changes, message):
    with pytest.raises(SearchError, match=message) as caught:
        problem(**changes)
    assert "\n" not in str(caught.value)
