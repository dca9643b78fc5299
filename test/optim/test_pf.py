"""Condensation: one layer, a fixed likelihood."""

import numpy as np

from markerless_tracker.optim import Pf, Problem, everything_feasible


def test_one_frame_by_hand():
    """Costs 0, 0.1, 0.2 at sharpness 10: weights 1, 1/e, 1/e²; the estimate is the mean."""
    search = Pf(
        Problem(
            bounds=np.array([[-np.inf], [np.inf]]),
            centre=np.array([1.0]),
            sigma=np.array([0.5]),
            particles=3,
            iterations=1,
            feasible=everything_feasible,
            rng=np.random.default_rng(2),
        ),
        sharpness=10.0,
    )
    rng = np.random.default_rng(2)
    rng.random(3)
    points = 1.0 + 0.5 * rng.standard_normal((3, 1))
    np.testing.assert_allclose(search.ask(), points, rtol=1e-15)
    search.tell(np.array([0.0, 0.1, 0.2]))
    weights = np.exp([0.0, -1.0, -2.0])
    expected = weights @ points / weights.sum()
    np.testing.assert_allclose(search.estimate, expected, rtol=1e-13)
    np.testing.assert_allclose(search.memory.weights, weights / weights.sum(), rtol=1e-13)
