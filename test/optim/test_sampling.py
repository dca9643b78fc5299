"""First samples: N(centre, sigma²), at most ten tries under constraints, then the centre."""

import numpy as np

from markerless_tracker.optim import Problem, everything_feasible
from markerless_tracker.optim.sampling import ATTEMPTS, gaussian_sample


def problem(n: int, feasible, seed: int = 0) -> Problem:
    return Problem(
        bounds=np.tile([[-np.inf], [np.inf]], (1, 2)),
        centre=np.array([2.0, -1.0]),
        sigma=np.array([0.5, 3.0]),
        particles=n,
        iterations=1,
        feasible=feasible,
        rng=np.random.default_rng(seed),
    )


def test_samples_have_the_mean_and_spread_asked_for():
    x = gaussian_sample(problem(20000, everything_feasible))
    np.testing.assert_array_less(np.abs(x.mean(axis=0) - [2.0, -1.0]), [0.02, 0.1])
    np.testing.assert_allclose(x.std(axis=0), [0.5, 3.0], rtol=0.03)


def test_only_those_that_break_a_constraint_are_drawn_again():
    calls = []

    def feasible(points):
        calls.append(len(points))
        return points[:, 0] > 2.0

    x = gaussian_sample(problem(1000, feasible))
    at_centre = np.all(x == [2.0, -1.0], axis=1)
    assert (x[~at_centre, 0] > 2.0).all()
    assert len(calls) <= ATTEMPTS == 10
    assert calls[0] == 1000
    # About half fail each time.
    for before, after in zip(calls, calls[1:], strict=False):
        assert 0.3 * before - 10 < after < 0.7 * before + 10
    # Those that pass at once are the first draws.
    first = problem(1000, everything_feasible).rng.standard_normal((1000, 2))
    kept = first[:, 0] > 0.0
    np.testing.assert_allclose(x[kept], ([2.0, -1.0] + [0.5, 3.0] * first)[kept])


def test_after_ten_failures_a_particle_starts_at_the_centre():
    calls = []

    def never(points):
        calls.append(len(points))
        return np.zeros(len(points), dtype=bool)

    x = gaussian_sample(problem(4, never))
    np.testing.assert_array_equal(x, np.tile([2.0, -1.0], (4, 1)))
    assert calls == [4] * ATTEMPTS
