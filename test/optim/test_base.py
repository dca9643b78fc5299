"""Turns of ask and tell: budget, best so far, bad costs; with an optimiser that only counts."""

import numpy as np
import pytest

from markerless_tracker.errors import SearchError
from markerless_tracker.optim import Optimizer, Problem, everything_feasible


class Counting(Optimizer):
    """Asks for (i, 0), (i, 1) .. in round i; the points listed are infeasible."""

    def __init__(self, problem: Problem, infeasible: frozenset[int] = frozenset()) -> None:
        super().__init__(problem)
        self.round = 0
        self.infeasible = infeasible
        self.costs: list[list[float]] = []

    def _ask(self):
        n = self.problem.particles
        points = np.column_stack([np.full(n, float(self.round)), np.arange(n, dtype=float)])
        return points, np.array([i in self.infeasible for i in range(n)])

    def _tell(self, points, costs):
        self.round += 1
        self.costs.append(costs.tolist())


@pytest.fixture
def problem() -> Problem:
    return Problem(
        bounds=np.tile([[-np.inf], [np.inf]], (1, 2)),
        centre=np.array([7.0, 8.0]),
        sigma=np.ones(2),
        particles=3,
        iterations=2,
        feasible=everything_feasible,
        rng=np.random.default_rng(0),
    )


def test_the_best_is_kept_and_never_gets_worse(problem):
    search = Counting(problem)
    np.testing.assert_array_equal(search.best_x, [7.0, 8.0])
    assert search.best_cost == np.inf
    search.ask()
    search.tell(np.array([3.0, 1.0, 2.0]))
    np.testing.assert_array_equal(search.best_x, [0.0, 1.0])
    search.ask()
    search.tell(np.array([1.5, 1.0, 9.0]))
    # An equal cost is no improvement.
    np.testing.assert_array_equal(search.best_x, [0.0, 1.0])
    assert (search.best_cost, search.evaluations, search.finished) == (1.0, 6, True)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_costs_that_are_not_finite_never_win_and_are_counted(problem, bad):
    search = Counting(problem)
    search.ask()
    search.tell(np.array([bad, 5.0, bad]))
    assert (search.best_cost, search.bad_costs) == (5.0, 2)
    assert search.costs == [[np.inf, 5.0, np.inf]]
    search.ask()
    search.tell(np.full(3, bad))
    assert (search.best_cost, search.bad_costs, search.evaluations) == (5.0, 5, 6)
    np.testing.assert_array_equal(search.best_x, [0.0, 1.0])


def test_with_bad_costs_alone_the_centre_stays_best(problem):
    search = Counting(problem)
    np.testing.assert_array_equal(search.run(lambda x: np.full(len(x), np.nan)), [7.0, 8.0])
    assert (search.best_cost, search.evaluations, search.bad_costs) == (np.inf, 6, 6)


def test_points_that_break_a_constraint_are_counted_but_never_win(problem):
    search = Counting(problem, infeasible=frozenset({0}))
    search.ask()
    search.tell(np.array([-100.0, 5.0, 6.0]))
    assert (search.best_cost, search.evaluations, search.bad_costs) == (5.0, 3, 0)
    np.testing.assert_array_equal(search.best_x, [0.0, 1.0])


def test_the_callers_costs_are_left_alone(problem):
    search = Counting(problem)
    search.ask()
    costs = np.array([np.nan, 1.0, 2.0])
    search.tell(costs)
    assert np.isnan(costs[0])


def test_out_of_order(problem):
    search = Counting(problem)
    with pytest.raises(SearchError, match="for no points asked for"):
        search.tell(np.zeros(3))
    search.ask()
    with pytest.raises(SearchError, match=r"ask\(\) was called out of order"):
        search.ask()
    for wrong in (np.zeros(2), np.zeros((3, 1)), np.zeros(4)):
        with pytest.raises(SearchError, match="for 3 points asked for"):
            search.tell(wrong)
    search.tell(np.zeros(3))
    search.run(lambda x: np.zeros(len(x)))
    with pytest.raises(SearchError, match="stop when finished"):
        search.ask()
