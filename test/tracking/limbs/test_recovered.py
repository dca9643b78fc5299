"""Limbs that were found elsewhere may jump there."""

import numpy as np
import pytest

from markerless_tracker.body import load_body
from markerless_tracker.tracking.limbs.recovered import RECOVERED_M, Recovered


@pytest.mark.parametrize(
    ("moved_m", "rotated", "allowed"),
    [(0.5 * RECOVERED_M, False, 0.2), (2.0 * RECOVERED_M, False, 1.0), (0.0, True, 1.0)],
)
def test_a_limb_jumps_only_from_where_it_was_wrong(moved_m, rotated, allowed) -> None:
    body = load_body("person31")
    pose, arm = body.neutral + 1.0, body.subspaces["l_arm"]
    near = [np.array([body.neutral - reach, body.neutral + reach]) for reach in (0.3, 0.2)]
    placed = Recovered(pose, ("l_arm",), rotated=rotated, moved_m=moved_m).placed(body, *near)
    np.testing.assert_allclose((placed - body.neutral)[arm], allowed)
    rest = np.setdiff1d(np.arange(body.size), arm)
    np.testing.assert_allclose((placed - body.neutral)[rest], 1.0 if rotated else 0.3)
