"""Other places of a limb, and how probable they are."""

import numpy as np
import pytest

from markerless_tracker.body import MARKER_NAMES, load_body, markers
from markerless_tracker.tracking.limbs.rivals import APART_M, COST_SCALE, rival_of


@pytest.fixture(scope="module")
def body():
    return load_body("person32", 1.75)


def bent(body, angle_rad):
    pose = body.neutral.copy()
    pose[body.index("l_elbow")] += angle_rad
    return pose


@pytest.mark.parametrize(
    "more_cost, probability",
    [(0.0, 0.5), (-0.01, 0.5), (COST_SCALE * np.log(3.0), 0.25), (0.05, 0.0), (np.inf, 0.0)],
)
def test_a_place_that_costs_more_is_less_probable(body, more_cost, probability) -> None:
    rival = rival_of(body, body.neutral, bent(body, 1.0), more_cost)
    assert rival is not None
    assert rival.probability == pytest.approx(probability, abs=1e-6)


def test_a_rival_knows_where_the_limb_would_be(body) -> None:
    pose, other = body.neutral, bent(body, 1.0)
    rival = rival_of(body, pose, other, 0.0)
    assert rival is not None
    np.testing.assert_array_equal(rival.moved, other - pose)
    np.testing.assert_allclose(rival.moved_m, markers(body, other) - markers(body, pose))
    assert set(np.flatnonzero(rival.moved_m.any(axis=1))) == {MARKER_NAMES.index("LWrist")}


def test_a_place_nearby_is_the_same(body) -> None:
    wrist, elbow = (MARKER_NAMES.index(name) for name in ("LWrist", "LElbow"))
    forearm_m = float(np.linalg.norm(np.subtract(*markers(body, body.neutral)[[wrist, elbow]])))
    angle_rad = 2.0 * np.arcsin(0.5 * APART_M / forearm_m)
    assert rival_of(body, body.neutral, bent(body, 0.98 * angle_rad), 0.0) is None
    assert rival_of(body, body.neutral, bent(body, 1.02 * angle_rad), 0.0) is not None
